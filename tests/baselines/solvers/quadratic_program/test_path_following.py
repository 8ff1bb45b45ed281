"""The policy `qp_path`: its program against SciPy, its speed against TOPP-RA, and paths that are too fast."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import lsq_linear

import ikgym
from baselines.solvers.quadratic_program.box_minimum import box_minimum
from baselines.solvers.quadratic_program.path_memory import interpolate_motion, moves_around, remember
from baselines.solvers.quadratic_program.path_speed import path_speed
from baselines.solvers.quadratic_program.program import STILL, TAKEN_ON, curvature, goal_along_path
from baselines.status import Status
from tests.baselines.solvers.quadratic_program.paths import beyond_reach, circle, played


def too_fast(**changes):
    return circle(speed=2.5, acceleration=100.0, **changes)


def followed(scenario, **parameters):
    """Distances in [m] from the reference at the progress of the policy, progress, statuses, and joints held back."""
    episode = played(scenario, "qp_path", **parameters)
    progress = episode.diagnostics["progress"]
    there = scenario.trajectory.frames(progress * scenario.dt, scenario.model)[:, -3:]
    return np.linalg.norm(episode.pose[:, -3:] - there, axis=1), progress, episode.status, episode.at_limit.sum()


@pytest.mark.parametrize("scale", [1e-10, 1e-7, 1e-3])
def test_is_the_minimum_that_it_states(scale):
    """Motions of the path that are nothing, tiny and usual, in units of those that the joints can make."""
    rng, between = np.random.default_rng(0), 0
    for _ in range(80):
        n, e = rng.integers(3, 9), rng.integers(2, 7)
        jacobian, motion = 1e-3 * rng.normal(size=(e, n)), scale * rng.normal(size=e)
        error, preferred = rng.choice([0.0, 1e-3]) * rng.normal(size=e), rng.normal(size=n)
        weight, speed, least = 10 ** rng.uniform(-10, -7), rng.uniform(0, 1), rng.choice([0.0, 0.3])
        lower, upper = np.append(-rng.uniform(0, 1, n), 0.0), np.append(rng.uniform(0, 1, n), 0.0)
        hessian, linear, x = np.empty((n + 1, n + 1)), np.empty(n + 1), np.empty(n + 1)
        weights = rng.uniform(0.1, 10.0, n)
        curvature(jacobian, weight, weights, hessian)
        length = goal_along_path(jacobian, motion, error, weight, weights, preferred, speed, hessian, linear)
        if length == 0.0:
            assert np.linalg.norm(motion) < STILL
            continue
        lower[n], upper[n] = least * length, length
        assert box_minimum(hessian, linear, lower, upper, x)[1]
        pull = np.sqrt(max(1e-2, TAKEN_ON / length))  # of the speed
        rows = np.zeros((e + n + 1, n + 1))
        rows[:e], rows[e:-1, :n], rows[-1, n] = (
            np.c_[jacobian, -motion / length],
            np.diag((weight * weights) ** 0.5),
            pull,
        )
        wanted = np.concatenate([error, (weight * weights) ** 0.5 * preferred, [pull * speed * length]])
        theirs = lsq_linear(rows, wanted, (lower, upper), method="bvls", tol=1e-15, max_iter=1000).x
        np.testing.assert_allclose(x[:n], theirs[:n], rtol=0, atol=1e-5)
        np.testing.assert_allclose(x[n] / length, theirs[n] / length, rtol=0, atol=1e-5)
        between += lower[n] < x[n] < upper[n]
    assert scale < STILL or between > 8


def test_the_reference_between_samples_is_a_spline_through_them():
    rng, length = np.random.default_rng(0), 10
    path, samples = np.cumsum(rng.normal(size=(40, 3)), axis=0), np.full((length, 3), np.nan)
    path[0] = path[1]
    for steps in range(30):  # the ring is written over three times
        remember(samples, steps, path[steps + 1 : steps + 6])
        first, moves, out = max(steps - 2, 0), np.empty((4, 3)), np.empty(3)
        moves_around(ikgym.tasks.get("position").kind, samples, first, moves)
        around = path[max(first - 1, 0) : first + 4]
        slopes = np.gradient(around, axis=0)
        spline = CubicHermiteSpline(np.arange(len(around)) - min(first, 1), around, slopes)
        for part in (0.0, 0.3, 1.0, 1.7, 2.0):
            interpolate_motion(moves, part, out)
            np.testing.assert_allclose(path[first] + out, spline(part), rtol=0, atol=1e-12)


def test_the_speed_is_that_of_time_optimal_parametrisation():
    """Against TOPP-RA on the same joint path, from every place to rest at its end."""
    algorithm, constraint = pytest.importorskip("toppra.algorithm"), pytest.importorskip("toppra.constraint")
    toppra = pytest.importorskip("toppra")
    places, stride = np.linspace(0.0, 100.0, 51), 2.0
    path = np.c_[0.9 * np.sin(places / 15), np.cos(places / 25), 0.01 * places]
    spline = toppra.SplineInterpolator(places, path)
    fastest, change = np.array([0.04, 0.05, 0.01]), np.array([2e-3, 1e-3, 1e-3])
    limits = [
        constraint.JointVelocityConstraint(np.c_[-fastest, fastest]),
        constraint.JointAccelerationConstraint(np.c_[-change, change]),
    ]
    sets = algorithm.TOPPRA(limits, spline, gridpoints=places).compute_controllable_sets(0.0, 0.0)
    tangents = np.ascontiguousarray(spline(places, 1)[:-1])
    ours = [path_speed(tangents[k:], stride, 0.0, 1.0, fastest, change) for k in range(len(tangents))]
    # The velocities of the present step are limits of the quadratic program.
    ratio = np.minimum(ours, (fastest / np.abs(tangents)).min(axis=1)) / np.sqrt(sets[:-1, 1])
    assert np.median(np.abs(ratio - 1.0)) < 0.02
    assert 0.9 < ratio.min() < ratio.max() < 1.2


def test_a_path_that_can_be_driven_is_driven_on_time():
    scenario = circle()
    distance, progress, status, held = followed(scenario)
    np.testing.assert_allclose(progress, np.arange(1, scenario.steps + 1), rtol=0, atol=1e-9)
    assert distance.max() < 2e-6
    assert held == 0
    assert {*status} == {Status.APPLIED}


def test_a_path_that_is_too_fast_becomes_slower_instead_of_wrong():
    scenario = too_fast(arm="iiwa14")
    distance, progress, _, held = followed(scenario.replace(steps=5 * scenario.steps))
    made = np.diff(progress, prepend=0.0)
    assert made.min() >= 0.0
    assert made.max() <= 1.0 + 1e-12
    end = np.argmax(progress >= scenario.steps)
    assert 1.5 * scenario.steps < end < 4 * scenario.steps
    assert distance.max() < 2e-5
    assert held == 0
    assert made[end:].min() == 1.0  # at rest, on the clock again
    assert played(scenario).position_error.max() > 1e-2  # by the clock


def test_without_a_view_ahead_it_cannot_slow_down_in_time():
    """With a view of four steps it thinks that the path ends there."""
    scenario = too_fast()
    assert followed(scenario, lookahead=0.004)[1][-1] < 0.9 * followed(scenario)[1][-1]


def test_it_is_led_on_where_it_may_fall_no_further_behind():
    scenario = too_fast()
    distance, progress, status, _ = followed(scenario, longest_lateness=0.05)
    late = np.arange(1, scenario.steps + 1) - progress
    assert late.max() == pytest.approx(50, abs=1e-9)
    assert {*status[late > 49.9]} == {Status.SATURATED}
    assert distance.max() > 1e-2


def test_where_the_path_leaves_the_reach_it_stands_still_and_says_so():
    scenario = beyond_reach()
    distance, progress, status, _ = followed(scenario)
    assert progress[-1] < 0.9 * scenario.steps
    assert np.diff(progress)[-1] < 1e-3
    assert status[-1] == Status.SATURATED
    assert distance.max() < 1e-3


def test_it_begins_where_the_arm_is():
    """From next to the path the arm goes to its first pose, and follows it from there."""
    scenario = circle()
    errors, progress, *_ = followed(scenario.replace(start=scenario.start_of(0) + 0.05))
    arrived = np.argmax(progress > 1.0)
    assert arrived > 100
    assert errors[arrived + 100 :].max() < 1e-6


def test_a_slow_joint_slows_nothing_down():
    """A torso that is soon at its velocity limit is made up for by the others, and not waited for."""
    usual = circle("tiago", dt=4e-3)
    fastest = np.append(0.003, usual.arm.velocity_limit[1:])
    scenario = usual.replace(arm=usual.arm.replace(velocity_limit=fastest, acceleration_limit=np.full(8, 8.0)))
    distance, progress, _, held = followed(scenario)
    assert scenario.steps - progress[-1] < 2.0
    assert distance.max() < 1e-5
    assert held == 0
