"""Joint paths along a whole reference, by dynamic programming."""

import numpy as np
import pytest

from baselines.paths.routes import Routes
from ikgym import scenarios, tasks
from ikgym.exceptions import InvalidInputError
from ikgym.obstacles import Sphere

#: From waypoint to waypoint of the published problems in [s].
PERIOD = 0.2
MATRIX = scenarios.get("panda-circle").replace(task=tasks.get("matrix"))


def routes_of(name, knots, turn, **changes):
    """The search along the first waypoints of a published problem."""
    scenario = scenarios.get(name).replace(steps=10 * (knots - 1), **changes)
    largest = np.where(scenario.arm.prismatic, 0.02, turn)
    return Routes(scenario, PERIOD * np.arange(knots), largest)


def postures(routes, knot, count):
    """Random postures at the pose of a knot, clear or not."""
    arm, frame = routes.scenario.arm, routes.scenario.trajectory.frames(routes.times[knot : knot + 1], None)[0]
    lower, upper = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    start = np.random.default_rng(knot).uniform(lower, upper, (count, arm.joints))
    q, met = arm.inverse(frame[:9].reshape(3, 3), frame[9:], start=start, restarts=0)
    return q[met]


def test_the_path_meets_all_poses_in_small_motions_and_is_clear():
    routes = routes_of("cppflow-panda-2cubes", 25, np.radians(5.0))
    scenario, q = routes.scenario, routes.route()
    rotations, positions = scenario.arm.forward(q)
    frames = scenario.trajectory.frames(routes.times, scenario.arm)
    np.testing.assert_allclose(positions, frames[:, 9:], atol=1e-8)
    np.testing.assert_allclose(rotations.reshape(-1, 9), frames[:, :9], atol=1e-8)
    assert (np.abs(np.diff(q, axis=0)) < routes.largest).all()
    assert ((q >= scenario.arm.lower) & (q <= scenario.arm.upper)).all()
    for part in (0.0, 0.25, 0.5, 0.75):
        between = q[:-1] + part * np.diff(q, axis=0)
        assert scenario.arm.clearance(between, scenario.obstacles)[0].min() > routes.margin
    np.testing.assert_array_equal(routes.route(), q)
    np.testing.assert_array_equal(routes.route(q[0])[0], q[0])


def test_its_motion_is_nearly_as_small_as_among_many_random_postures():
    """All postures at all knots, each pair of them a step: the same program with no null space and no cells."""
    routes = routes_of("cppflow-panda-1cube", 7, np.radians(20.0), collisions=False)
    q = routes.route()
    mine = ((np.diff(q, axis=0) / routes.largest) ** 2).sum()
    before, cost = postures(routes, 0, 1500), np.zeros(1)
    cost = np.zeros(len(before))
    for knot in range(1, 7):
        after = postures(routes, knot, 1500)
        steps = (((after[:, None] - before) / routes.largest) ** 2).sum(axis=2)
        before, cost = after, (cost + steps).min(axis=1)
    assert mine < 1.05 * cost.min()


def test_where_no_step_is_small_enough_the_way_ends():
    """The waypoints of this problem are farther apart than 7° a joint, among random postures as well."""
    routes = routes_of("rlitg-obstacle-056", 20, np.radians(7.0), collisions=False)
    end = len(routes.route())
    assert 1 < end < 20
    before, after = postures(routes, end - 1, 1500), postures(routes, end, 1500)
    nearest = min(np.abs(after - one).max(axis=1).min() for one in before)
    assert np.degrees(nearest) > 8.0


def test_steps_close_to_the_largest_are_found():
    """Three steps of this path come within 1 % of 7°; found to first order only, they would be larger."""
    whole = routes_of("rlitg-obstacle-011", 82, np.radians(7.0), collisions=False)
    routes = Routes(whole.scenario, whole.times[70:], whole.largest)
    near = np.array([-0.35, 0.49, 2.90, 1.63, -3.21, 1.79, 1.12])
    frame = whole.scenario.trajectory.frames(routes.times[:1], None)[0]
    start, met = whole.scenario.arm.inverse(frame[:9].reshape(3, 3), frame[9:], start=near)
    steps = np.abs(np.diff(routes.route(start), axis=0)).max(axis=1) / routes.largest[0]
    assert met
    assert len(steps) == 11
    assert 0.99 < steps.max() < 1.0


def test_obstacles_end_a_way_and_a_start_that_touches_has_none():
    at = routes_of("cppflow-panda-1cube", 2, 1.0).scenario.trajectory.frames(np.array([30 * PERIOD]), None)[0, 9:]
    blocked = routes_of("cppflow-panda-1cube", 31, np.radians(7.0), obstacles=[Sphere("ball", at, 0.01)])
    assert 1 < len(blocked.route()) < 31
    touching = postures(blocked, 30, 5)[0]
    assert blocked.scenario.arm.clearance(touching, blocked.scenario.obstacles)[0] < 0.0
    at_the_end = Routes(blocked.scenario, blocked.times[::-1], blocked.largest)
    assert at_the_end.route(touching).shape == (0, 7)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: routes_of("cppflow-panda-1cube", 3, -1.0), "largest"),
        (lambda: Routes(scenarios.get("rlitg-random"), [0.0, 0.2], np.ones(7)), "expected one path, and a task of"),
        (
            lambda: Routes(MATRIX, [0.0, 0.2], np.ones(7)),
            "expected one path, and a task of",
        ),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(InvalidInputError, match=message):
        make()
