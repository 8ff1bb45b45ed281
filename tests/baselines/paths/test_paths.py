"""Branches of a path, and paths in the time in which they can be driven, played by the environment itself."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines.controller import Guards, StopReason
from baselines.paths import Branch, retime, survey
from baselines.paths.late import play_late
from baselines.paths.motion import ideal, path_duration, play_from
from baselines.paths.survey import FOLLOWED, REACHED
from baselines.paths.timing import Timing
from docs.retimed import PATHS, by_one_factor, faster
from ikgym.exceptions import InvalidInputError


def check_driven(retimed):
    """The environment plays what was promised: on the path, within all limits, nobody held back."""
    scenario = retimed.scenario
    tracking = baselines.track(scenario, retimed.solver)
    assert tracking.position_error.max() <= FOLLOWED[0]
    assert np.nan_to_num(tracking.orientation_error).max() <= FOLLOWED[1]
    q, qdot, arm = tracking.q, tracking.qdot, scenario.arm
    assert (arm.lower <= q).all()
    assert (q <= arm.upper).all()
    assert (np.abs(qdot) <= (1.0 + 1e-6) * arm.velocity_limit).all()
    qddot = np.diff(np.vstack([np.zeros(arm.joints), qdot]), axis=0) / scenario.dt
    assert (np.abs(qddot) <= (1.0 + 1e-4) * arm.acceleration_limit).all()
    end = retimed.scenario.trajectory.frames(np.array([retimed.duration]), arm)
    np.testing.assert_allclose(tracking.nominal[-1][-3:], end[0, -3:], atol=1e-9)


@pytest.mark.parametrize(
    "path", [pytest.param(path, marks=() if path[0] == "tiago-fast" else pytest.mark.slow) for path in PATHS], ids=str
)
def test_a_path_that_is_too_fast(path):
    scenario = faster(*path)
    found = survey(scenario)
    assert not found.drivable
    retimed = retime(found)
    check_driven(retimed)
    starts = scenario.start_of(), retimed.scenario.start
    assert retimed.duration <= 1.05 * min(by_one_factor(scenario, start) for start in starts)
    # The same places in space, later.
    base = retimed.scenario.trajectory.base_times(np.linspace(0.0, retimed.duration, 50))
    assert (np.diff(base) > 0.0).all()
    assert base[-1] == pytest.approx(path_duration(scenario))


def test_another_start_drives_what_the_own_one_does_not():
    scenario = ikgym.scenarios.get("panda-turn")
    assert baselines.track(scenario, "qp").position_error.max() > 1e-3
    found = survey(scenario)
    assert found.drivable
    retimed = retime(found)
    assert retimed.duration == found.duration
    check_driven(retimed)
    assert retime(found, fastest=True).duration < 0.8 * found.duration


def test_a_start_that_is_given_is_kept_where_it_will_do():
    scenario = ikgym.scenarios.get("panda-square")
    found = survey(scenario)
    best = found.best
    other = next(b for b in found.branches[1:] if b.whole and b.room.min() > 0.05 and b.slowing == 1.0)
    assert not best.given
    given = survey(scenario.replace(start=other.start)).best
    assert given.given
    np.testing.assert_array_equal(given.start, other.start)


def test_random_paths_are_refused():
    with pytest.raises(InvalidInputError, match="the same at every reset, got scenario 'panda-random'"):
        survey(ikgym.scenarios.get("panda-random"))


@pytest.mark.slow
def test_a_path_through_singularities_has_a_solver():
    found = survey(ikgym.scenarios.get("panda-singular"))
    retimed = retime(found)
    assert retimed.motion.position_error.max() <= FOLLOWED[0]
    assert baselines.track(retimed.scenario, retimed.solver).position_error.max() <= REACHED[0]


def test_a_long_path_has_coarse_plays():
    """Plays in 30 times the time have control periods that the gains of `qp` do not suit."""
    scenario = ikgym.scenarios.get("panda-circle")
    slow = scenario.replace(trajectory=Timing.uniform(path_duration(scenario), 200.0).of(scenario.trajectory), dt=0.5)
    begin = slow.start_of()[None]
    assert play_from(ideal(slow.replace(steps=None), start=begin[0]), begin).position_error.max() < 5e-3


def test_a_reserve_is_left_to_feedback():
    scenario = faster("tiago-fast", 1)
    found = survey(scenario, reserve=0.2)
    less = retime(found)
    check_driven(less)
    motion = found.play("qp", less.scenario.start, trajectory=less.scenario.trajectory)[0]
    qdot = np.diff(motion.q[:, 0], axis=0) / scenario.dt
    assert (np.abs(qdot) <= 0.8 * (1.0 + 1e-6) * scenario.largest_qdot).all()
    # The arm states no accelerations: those of the control loop, which follows on drives that lag.
    assert not np.isfinite(scenario.arm.acceleration_limit).any()
    qddot, allowed = np.diff(qdot, axis=0) / scenario.dt, Guards().acceleration(scenario.arm)
    assert (np.abs(qddot) <= 0.8 * (1.0 + 1e-4) * allowed).all()
    loop = play_late(less.scenario, less.solver)
    assert loop.stopped is None
    assert 1e-4 < loop.error < 5e-3
    assert loop.time == pytest.approx(less.duration, abs=scenario.dt)
    assert play_late(retime(scenario).scenario, "qp").stopped == StopReason.PATH_ERROR
    # Limits of the scenario that is written are those of the arm.
    np.testing.assert_array_equal(less.scenario.arm.velocity_limit, scenario.arm.velocity_limit)
    np.testing.assert_array_equal(less.scenario.velocity_limit, scenario.velocity_limit)
    with pytest.raises(InvalidInputError, match="reserve: expected"):
        survey(scenario, reserve=1.0)


def test_a_joint_far_from_its_stop_comes_above_one_that_is_wound_up():
    numbers = {"start": np.zeros(1), "given": False, "slowing": 1.0, "reached": 1.0, "leap": 0.0, "contact": None}
    zero = dict.fromkeys(("velocity", "acceleration"), np.zeros(1))
    error = dict.fromkeys(("position_error", "orientation_error"), 0.0)

    def branch(room, shortest):
        timings = {"shortest": Timing.uniform(shortest, 1.0), "asked": Timing.uniform(2.0, 1.0)}
        return Branch(**numbers, **zero, **error, **timings, room=np.array([room]))

    assert branch(0.8, 1.1).rank() < branch(0.3, 1.0).rank()
    assert branch(0.9, 1.1).rank() > branch(1.9, 1.0).rank()
