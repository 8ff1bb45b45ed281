"""Joint motions that are planned along the whole path, where no start branch leads to its end."""

import numpy as np
import pytest

import baselines
from baselines.paths import survey
from baselines.paths.motion import path_duration
from baselines.paths.planning import PLAYER, plan
from baselines.paths.survey import FOLLOWED, Survey
from ikgym import scenarios, tasks
from ikgym.obstacles.solids import closest
from tests.bodied import POST, crowd
from tests.robots import ROBOTS


def unsurveyed(scenario, reserve=0.1):
    """A survey without branches: any start will do."""
    return Survey(scenario, path_duration(scenario), (), reserve)


def check(scenario, reserve):
    """The written scenario plays within the errors, the limits less the reserve, and clear."""
    assert scenario.policy == PLAYER
    tracking = baselines.track(scenario, scenario.policy)
    assert tracking.position_error.max() < FOLLOWED[0]
    assert np.nan_to_num(tracking.orientation_error).max() < FOLLOWED[1]
    arm, left = scenario.arm, (1.0 + 1e-4) * (1.0 - reserve)
    assert ((arm.lower < tracking.q) & (tracking.q < arm.upper)).all()
    assert (np.abs(tracking.qdot) <= left * scenario.largest_qdot).all()
    qddot = np.diff(np.vstack([np.zeros(arm.joints), tracking.qdot]), axis=0) / scenario.dt
    assert (np.abs(qddot) <= left * arm.acceleration_limit).all()
    if scenario.collides:
        rows = scenario.obstacle_rows(len(tracking.q) + 1)
        rows = rows[1:] if len(rows) > 1 else rows
        assert closest(arm, tracking.q, rows, scenario.surroundings.checked).distances.min() > 0.0
    end = scenario.trajectory.frames(np.array([scenario.trajectory.duration]), arm)[0]
    np.testing.assert_allclose(tracking.nominal[-1][-3:], end[-3:], atol=1e-9)


@pytest.mark.parametrize("task", ["pose", *(pytest.param(one, marks=pytest.mark.slow) for one in ("axis", "position"))])
def test_a_motion_along_the_path_within_all_limits(task):
    scenario = scenarios.get("panda-line").replace(task=tasks.get(task), dt=0.01, steps=None)
    planned = plan(unsurveyed(scenario))
    assert planned.reached == planned.motion.asked
    check(planned.motion.scenario, 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda-shelf", "tiago-pillar"])
def test_motions_beside_obstacles(name):
    check(plan(unsurveyed(scenarios.get(name))).motion.scenario, 0.1)


def test_an_arm_without_a_null_space_begins_in_the_branch_that_leads_to_the_end():
    scenario = ROBOTS["ur10"].scenario("ur10").replace(dt=0.02, steps=None)
    check(plan(unsurveyed(scenario)).motion.scenario, 0.1)


def test_the_start_of_the_only_branch_is_kept():
    scenario = scenarios.get("panda-circle").replace(dt=0.01, steps=None)
    start = survey(scenario, begin=scenario.start_of()[None]).best
    planned = plan(Survey(scenario, path_duration(scenario), (start,)))
    np.testing.assert_array_equal(planned.motion.scenario.start, scenario.start_of())


def test_where_there_is_no_way_the_search_ends():
    blocked = crowd(None, (POST.replace(position=[0.4, 0.12, 0.25], size=[0.06, 0.06, 0.5]),)).replace(dt=4e-3)
    planned = plan(unsurveyed(blocked))
    assert planned.motion is None
    assert 0.2 < planned.reached / path_duration(blocked) < 0.4
    assert plan(unsurveyed(blocked.replace(task=tasks.get("matrix")))) is None
