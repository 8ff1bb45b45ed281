"""Branches of a path, and paths in the time in which they can be driven, played by the environment itself."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines.paths import retime, survey
from baselines.paths.motion import path_duration
from baselines.paths.survey import FOLLOWED, REACHED
from docs.retimed import PATHS, by_one_factor, faster
from ikgym.exceptions import InvalidInputError


def check_driven(retimed):
    """The environment plays what was promised: on the path, within all limits, nobody held back."""
    scenario = retimed.scenario
    tracking = baselines.track(scenario, "qp")
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
def test_a_path_that_nothing_follows_closely():
    """Through singularities `qp` errs by some tenths of a millimetre at any speed."""
    found = survey(ikgym.scenarios.get("panda-singular"))
    retimed = retime(found)
    assert FOLLOWED[0] < retimed.motion.position_error.max() <= REACHED[0]
    assert baselines.track(retimed.scenario, "qp").position_error.max() <= REACHED[0]
