"""What the viewer shows, moment by moment."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.cli.view import session_of
from baselines.viewer import session as sessions
from baselines.viewer.approach import Pose
from baselines.viewer.panel import escaped, readings
from baselines.viewer.replay import Stage
from baselines.viewer.session import PLAYS_ONLY, Mode

STEPS = 40


@pytest.fixture(autouse=True)
def time_enough(monkeypatch):
    monkeypatch.setattr(sessions, "BUDGET", 60.0)


@pytest.fixture
def session():
    return session_of(Stage.of("panda-circle", steps=STEPS), ["dls", "qp"])


def above(session, height):
    """A target that is higher than the reference by so many [m]."""
    return Pose(session.reference.rotation, session.reference.position + np.array([0.0, 0.0, height]))


def test_it_begins_at_the_start_of_the_episode(session):
    assert (session.mode, session.playing, session.step) == (Mode.PLAY, False, 0)
    for one in session.shown():
        np.testing.assert_array_equal(one.q, session.stage.start)
        assert one.cost == 0.0


def test_playing_shows_each_policy_at_the_same_moment(session):
    session.toggle()
    session.advance(0.01)
    assert session.step == 10
    for one, replay in zip(session.shown(), session.replays, strict=True):
        np.testing.assert_array_equal(one.q, replay.q[10])
        assert (one.position_error, one.cost) == (replay.position_error[10], replay.cost[10])
    np.testing.assert_array_equal(session.reference.position, session.stage.path[10])


def test_speed_pause_and_end(session):
    session.toggle()
    session.speed = 2.0
    session.advance(0.005)
    assert session.time == pytest.approx(0.01)
    session.toggle()
    session.advance(1.0)
    assert session.time == pytest.approx(0.01)
    session.toggle()
    session.advance(1.0)
    assert (session.step, session.playing) == (STEPS, False)
    session.toggle()  # begins again
    assert (session.time, session.playing) == (0.0, True)


def test_scrubbing(session):
    session.toggle()
    session.scrub(0.025)
    assert (session.step, session.playing) == (25, False)
    session.scrub(99.0)
    assert session.step == STEPS
    np.testing.assert_array_equal(session.shown()[1].q, session.replays[1].q[-1])


def test_joints_by_hand_stay_within_the_limits(session):
    arm = session.stage.scenario.arm
    session.place(np.full(7, 10.0))
    for one in session.shown():
        np.testing.assert_array_equal(one.q, arm.upper)
        np.testing.assert_allclose(one.reading.margins, 0.0, atol=1e-12)
        assert one.position_error == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(session.reference.position, arm.forward(arm.upper)[1], atol=1e-12)


def test_arms_follow_a_target_from_where_they_are(session):
    session.scrub(0.02)
    before = [one.q for one in session.shown()]
    target = above(session, 0.005)
    session.aim(target)
    assert session.mode is Mode.FOLLOW
    for one, q in zip(session.shown(), before, strict=True):
        np.testing.assert_array_equal(one.q, q)
    session.advance(1.0)
    for one in session.shown():
        _, tool = session.stage.scenario.arm.forward(one.q)
        np.testing.assert_allclose(tool, target.position, atol=1e-4)
    assert session.kept == pytest.approx(1.0)


def test_time_that_is_no_whole_step_is_not_lost(session):
    session.aim(above(session, 0.05))
    start = session.reference.position
    for _ in range(10):
        session.advance(0.0005)
    assert np.linalg.norm(session.reference.position - start) == pytest.approx(5 * session.stage.pace[0], rel=1e-9)


def test_slow_policies_hold_the_target_back(session, monkeypatch):
    """The picture comes in time, and says which share of the speed was kept."""
    monkeypatch.setattr(sessions, "BUDGET", 0.0)
    session.aim(above(session, 0.05))
    start = session.reference.position
    for _ in range(30):
        session.advance(0.02)
    np.testing.assert_array_equal(session.reference.position, start)
    assert session.kept < 0.01
    assert "keep up with 0%" in readings(session, session.shown())


def test_readings_name_policies_errors_and_limits(session):
    session.scrub(0.04)
    text = readings(session, session.shown())
    assert "t = 0.040 s" in text
    assert "**dls**: applied" in text
    assert "**qp**" in text
    assert text.count("manipulability") == 2
    one = session.shown()[0]
    assert f"error {1e3 * one.position_error:.3g} mm, {1e3 * one.orientation_error:.3g} mrad" in text
    nearest = int(np.argmin(one.reading.margins))
    name = session.stage.scenario.arm.joint_names[nearest]
    assert f"{escaped(name)} is {one.reading.margins[nearest]:.3g} rad from its limit" in text
    assert "cost so far" in text


def test_privileged_information_plays_only():
    session = session_of(Stage.of("varga7-fast", steps=5), ["follow_nominal", "dls"])
    session.aim(above(session, 0.01))
    session.advance(0.003)
    reference, solver = session.shown()
    assert reference.status == PLAYS_ONLY
    np.testing.assert_array_equal(reference.q, session.stage.start)
    assert np.abs(solver.q - session.stage.start).max() > 0.0
    assert "from its limit" not in readings(session, session.shown())  # an arm without limits


def test_names_are_shown_letter_by_letter():
    assert escaped("rhc:options={'a': 1}\n<b>_x*") == "rhc:options=\\{'a': 1\\} \\<b\\>\\_x\\*"
