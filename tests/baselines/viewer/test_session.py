"""What the viewer shows, moment by moment: the episode as the environment has it, and arms that follow a target."""

import numpy as np
import pytest

import baselines
from baselines.evaluation.table import escape_markdown
from baselines.viewer import session as sessions
from baselines.viewer.following import Approach, Follower
from baselines.viewer.replay import Stage, play_all
from baselines.viewer.session import PLAYS_ONLY, Mode, Session
from ikgym.exceptions import IkgymError
from ikgym.kernels.rotations import geodesic_angle, rodrigues

STEPS = 40


@pytest.fixture(autouse=True)
def time_enough(monkeypatch):
    monkeypatch.setattr(sessions, "BUDGET", 60.0)


@pytest.fixture(scope="module")
def stage():
    return Stage.of("panda-circle", steps=STEPS)


@pytest.fixture
def session(stage):
    return Session(stage, ["dls", "qp"])


def moved(frame, shift, turn=0.0):
    """A frame that is shifted by a vector in [m] and turned by an angle in [rad]."""
    rotation = rodrigues(np.array([0.0, 0.6, 0.8]), turn) @ frame[:9].reshape(3, 3)
    return np.append(rotation, frame[9:] + np.array(shift))


@pytest.mark.parametrize("scenario", ["varga7-random", "faitli3-regular"])
def test_a_replay_is_the_episode(scenario):
    stage = Stage.of(scenario, seed=3, steps=12)
    (replay,) = play_all(stage, ["dls", "dls"])
    track, task = baselines.track(stage.scenario, "dls", seed=3), stage.scenario.task
    np.testing.assert_array_equal(replay.q, np.vstack([stage.start, track.q]))
    for name in ("position_error", "orientation_error"):
        np.testing.assert_array_equal(getattr(replay, name)[1:], getattr(track, name))
    np.testing.assert_allclose(np.diff(replay.cost), track.cost, rtol=1e-9)
    assert np.isnan(replay.orientation_error).all() == (not task.has_orientation)
    found = task.coordinates(stage.frames[:, :9].reshape(-1, 3, 3), stage.frames[:, 9:])
    np.testing.assert_allclose(found, stage.scenario.nominal(3), atol=1e-12)


def test_bad_stages_and_policies(stage):
    for options in (("panda-cirkle",), ("panda-circle", -1), ("panda-circle", 0, 0)):
        with pytest.raises(IkgymError):
            Stage.of(*options)
    for policies in ([], ["dlss"]):
        with pytest.raises(IkgymError):
            play_all(stage, policies)


@pytest.mark.parametrize(("steps", "turns"), [(50, 20), (10, 40)])
def test_the_reference_goes_straight_at_the_pace_of_the_slower_part(stage, steps, turns):
    whole = Stage.of("panda-circle")
    length = np.linalg.norm(np.diff(whole.frames[:, 9:], axis=0), axis=1).sum()
    assert stage.pace == whole.pace  # although it begins slowly
    assert stage.pace[0] == pytest.approx(length / whole.scenario.steps)
    way, start, needed = Approach(stage), stage.frames[0], max(steps, turns)
    target = moved(start, [steps * stage.pace[0], 0.0, 0.0], turns * stage.pace[1])
    way.aim(target)
    ahead = way.ahead(range(needed + 3))
    np.testing.assert_allclose(ahead[0], start, atol=1e-9)
    np.testing.assert_allclose(ahead[needed:], np.tile(target, (3, 1)), atol=1e-9)
    np.testing.assert_allclose(ahead[: needed + 1, 9:], np.linspace(start[9:], target[9:], needed + 1), atol=1e-8)
    for k in range(1, needed):
        angle = geodesic_angle(start[:9].reshape(3, 3), ahead[k, :9].reshape(3, 3))
        assert angle == pytest.approx(turns * stage.pace[1] * k / needed, abs=1e-6)
        way.advance()
        np.testing.assert_array_equal(way.frame, ahead[k])
    way.aim(start)  # a new target does not make it jump
    np.testing.assert_allclose(way.frame, ahead[needed - 1], atol=1e-12)


def test_a_placed_arm_has_forgotten(stage):
    follower = Follower(stage.scenario, baselines.make("mfac", stage.scenario), stage.start)
    way, first = Approach(stage), []
    for _ in range(2):
        follower.place(stage.start)
        way.place(stage.frames[0])
        way.aim(moved(stage.frames[0], [0.0, 0.02, 0.0]))
        follower.step(way)
        first.append(follower.q)
        way.advance()
        follower.step(way)
    np.testing.assert_array_equal(*first)
    assert np.abs(first[0] - stage.start).max() > 0.0


def test_play_speed_pause_end_and_scrub(session):
    assert (session.mode, session.playing, session.step) == (Mode.PLAY, False, 0)
    for one in session.views():
        np.testing.assert_array_equal(one.scene.q, session.stage.start)
    session.toggle()
    session.advance(0.01)
    assert session.step == 10
    for one, replay in zip(session.views(), session.replays, strict=True):
        np.testing.assert_array_equal(one.scene.q, replay.q[10])
        assert (one.position_error, one.cost) == (replay.position_error[10], replay.cost[10])
    np.testing.assert_array_equal(session.reference, session.stage.frames[10])
    session.speed = 2.0
    session.advance(0.005)
    session.toggle()
    session.advance(1.0)
    assert session.time == pytest.approx(0.02)
    session.toggle()
    session.advance(1.0)
    assert (session.step, session.playing) == (STEPS, False)
    session.toggle()  # begins again
    assert (session.time, session.playing) == (0.0, True)
    session.scrub(0.025)
    assert (session.step, session.playing) == (25, False)
    session.scrub(99.0)
    assert session.step == STEPS


def test_joints_by_hand_stay_within_the_limits(session):
    arm = session.stage.scenario.arm
    session.place(np.full(7, 10.0))
    for one in session.views():
        np.testing.assert_array_equal(one.scene.q, arm.upper)
        np.testing.assert_allclose(one.reading.margins, 0.0, atol=1e-12)
        assert one.position_error == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(session.reference[9:], arm.forward(arm.upper)[1], atol=1e-12)


def test_arms_follow_a_target_from_where_they_are(session):
    session.scrub(0.02)
    before = [one.scene.q for one in session.views()]
    target = moved(session.reference, [0.0, 0.0, 0.005], 0.02)
    session.aim(target)
    assert session.mode is Mode.FOLLOW
    for one, q in zip(session.views(), before, strict=True):
        np.testing.assert_array_equal(one.scene.q, q)
    session.advance(2.0)
    for one in session.views():
        assert one.position_error < 1e-4
        assert one.orientation_error < 1e-3
        np.testing.assert_allclose(session.stage.scenario.arm.forward(one.scene.q)[1], target[9:], atol=1e-4)
    assert session.kept == pytest.approx(1.0)
    session.aim(moved(target, [3.0, 0.0, 0.0]))  # out of reach
    arm = session.stage.scenario.arm
    for _ in range(10):
        session.advance(0.1)
        for one in session.views():
            assert ((arm.lower <= one.scene.q) & (one.scene.q <= arm.upper)).all()


def test_part_of_a_step_is_not_lost(session):
    session.aim(moved(session.reference, [0.0, 0.0, 0.05]))
    start = session.reference[9:]
    for _ in range(10):
        session.advance(0.0005)
    assert np.linalg.norm(session.reference[9:] - start) == pytest.approx(5 * session.stage.pace[0], rel=1e-6)


def test_slow_policies_hold_the_target_back(session, monkeypatch):
    """The picture comes in time, and says which share of the speed was kept."""
    monkeypatch.setattr(sessions, "BUDGET", 0.0)
    session.aim(moved(session.reference, [0.0, 0.0, 0.05]))
    start = session.reference
    for _ in range(30):
        session.advance(0.02)
    np.testing.assert_array_equal(session.reference, start)
    assert session.kept < 0.01
    assert "keep up with 0%" in session.text(session.views())


def test_readings_name_policies_errors_and_limits(session):
    session.scrub(0.04)
    shown = session.views()
    text, reading = session.text(shown), shown[0].reading
    joint = int(np.argmin(reading.margins))
    name = escape_markdown(session.stage.scenario.arm.joint_names[joint])
    for part in (
        "t = 0.040 s", "**dls**: applied", "**qp**", "manipulability", "cost so far",
        f"error {1e3 * shown[0].position_error:.3g} mm, {1e3 * shown[0].orientation_error:.3g} mrad",
        f"{name} is {reading.margins[joint]:.3g} rad from its limit",
    ):  # fmt: skip
        assert part in text


def test_privileged_information_plays_only():
    session = Session(Stage.of("varga7-fast", steps=5), ["follow_nominal", "dls"])
    session.aim(moved(session.reference, [0.0, 0.0, 0.01]))
    session.advance(0.003)
    reference, solver = session.views()
    assert reference.status == PLAYS_ONLY
    np.testing.assert_array_equal(reference.scene.q, session.stage.start)
    assert np.abs(solver.scene.q - session.stage.start).max() > 0.0
    assert "from its limit" not in session.text(session.views())  # an arm without limits
