"""The policy `qp` against SciPy's solution of the program that it states, and in motion."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import baselines
import ikgym
from baselines.policy import Batch
from baselines.solvers.quadratic_program.velocity_box import velocity_box
from baselines.solvers.resolved_rate.base import NominalMemory
from baselines.status import Status
from tests.baselines.solvers.quadratic_program.paths import beyond_reach, circle, played
from tests.limited import limited

#: SciPy gives up early by default.
BVLS = {"method": "bvls", "tol": 1e-15, "max_iter": 1000}


def states(scenario, rows, far, seed=0):
    """Observations of arms in motion within their limits, whose next reference is as far away as a step may lead.

    Args:
        scenario: The arm and its task.
        rows: How many.
        far: Multiples of what the arm could make of its velocity limits; beyond 1 not all can be made.
        seed: Of the draw.
    """
    rng, model = np.random.default_rng(seed), scenario.model
    lower, upper = np.maximum(model.lower, -2.0), np.minimum(model.upper, 2.0)
    q = lower + rng.uniform(0, 1, (rows, model.joints)) * (upper - lower)
    q[::3] = np.where(rng.random(q[::3].shape) < 0.5, upper, q[::3])  # some at their stops
    last = rng.uniform(-0.3, 0.3, q.shape) * np.minimum(scenario.velocity_limit, 3.0)
    pose = scenario.task.coordinates(*model.forward(q))
    step = far * scenario.dt * rng.uniform(-1, 1, q.shape) * np.minimum(scenario.velocity_limit, 3.0)
    nominal = scenario.task.coordinates(*model.forward(q + step))
    before = scenario.task.coordinates(*model.forward(q + 0.3 * step))
    return Batch(q, last, pose, nominal[:, None], np.ones((rows, 1))), NominalMemory(before, np.ones(rows, np.bool_))


def secondary(policy, q, hessian, weight, primary):
    """The motion z to the posture: without what moves the task, at most half as large as the primary one, in W.

    Joints with less than a third of the largest velocity have at most 0.15 of theirs.
    """
    (gain, posture), joints = policy.numbers().pull, policy.numbers().weights
    z = np.linalg.solve(hessian, weight * joints * gain * (posture - q))
    larger = np.sqrt((joints * z**2).sum() / (joints * primary**2).sum()) / 0.5
    fastest = policy.problem.largest_qdot
    slow = np.where(3.0 * fastest < fastest.max(), np.abs(z) / (0.15 * fastest), 0.0)
    return z / max(larger, slow.max(), 1.0)


def program(policy, batch, memory, i, scale=1.0):
    """The least squares of the docstring, for row i, without braking: matrix, goal, bounds, J Δt and Δx."""
    problem, model = policy.problem, policy.problem.model
    rotation, _, geometric = model.forward_and_jacobian(batch.q[i])
    jacobian = problem.dt * problem.task.jacobian(rotation, geometric)
    error = policy.gain * problem.task.error(memory.nominal[i], batch.pose[i])
    shift = problem.task.error(batch.nominal[i, 0], memory.nominal[i]) + error
    turning = {"position": slice(0, 0), "pose": slice(3, 6), "axis": slice(3, 5)}
    for rows in (jacobian, error, shift):
        rows[turning.get(problem.task.name, slice(0, len(error) - 3))] *= policy.rotation_weight
    joints = policy.numbers().weights
    rho = policy.damping * np.sum(jacobian**2 / joints) / model.joints
    rho += policy.lm_damping * (error @ error) / problem.largest_qdot.max() ** 2
    lower, upper = np.empty(model.joints), np.empty(model.joints)
    velocity_box(problem.limits, problem.dt, batch.q[i], batch.qdot[i], lower, upper)
    hessian, root = jacobian.T @ jacobian + scale * rho * np.diag(joints), np.diag(np.sqrt(rho * joints))
    z = secondary(policy, batch.q[i], hessian, scale * rho, np.linalg.solve(hessian, jacobian.T @ shift))
    matrix, goal = np.vstack([jacobian, root]), np.concatenate([shift, root @ z])
    return matrix, goal, (lower, upper), jacobian, shift


SCENARIOS = {
    "panda": circle(),
    "tiago": circle("tiago", dt=4e-3),
    "fetch": circle("fetch", dt=4e-3),
    "axis": circle(task=ikgym.tasks.get("axis")),
    "position": circle(task=ikgym.tasks.get("position")),
    "some limits": limited(),
    "no limits": ikgym.scenarios.get("varga7-fast"),
    "matrix": ikgym.scenarios.get("khan8-q1"),
}


def minimum(matrix, goal, lower, upper):
    fixed = 1e-13 * (lower == upper)  # which SciPy refuses
    return lsq_linear(matrix, goal, (lower - fixed, upper + fixed), **BVLS).x


@pytest.mark.parametrize(("far", "rotation_weight"), [(0.6, 1.0), (3.0, 0.2)])
@pytest.mark.parametrize("on", SCENARIOS)
def test_is_the_minimum_that_it_states(on, far, rotation_weight):
    numbers = {"damping": 1e-3, "lm_damping": 1e-2, "posture": 0.3, "secondary_gain": 2.0, "gain": 0.7}
    policy = baselines.make("qp", SCENARIOS[on], **numbers, rotation_weight=rotation_weight, braking_share=0.0)
    (batch, memory), bound, unlimited = states(SCENARIOS[on], 25, far), 0, on in ("no limits", "matrix")
    solution = policy.solve(batch, memory)
    for i, ours in enumerate(solution.qdot):
        matrix, goal, (lower, upper), *_ = program(policy, batch, memory, i)
        theirs = minimum(matrix, goal, lower, upper)
        assert ((lower <= ours) & (ours <= upper)).all()
        bound += ((ours == lower) | (ours == upper)).any()
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6 * np.abs(theirs).max())
    assert (solution.iterations == 1).all() if unlimited else bound > 4


@pytest.mark.parametrize("on", ["tiago", "no limits"])
def test_scaling_is_the_minimum_that_it_states(on):
    scenario = SCENARIOS[on]
    policy = baselines.make("qp", scenario, task_scaling=True, damping=1e-2, posture=0.3, braking_share=0.0)
    batch, memory = states(scenario, 25, 4.0, seed=2)
    solution = policy.solve(batch, memory)
    for i in range(25):
        matrix, goal, (lower, upper), jacobian, shift = program(policy, batch, memory, i, scale=1e-2)
        weight, e = 1e-2, len(shift)
        length = np.linalg.norm(shift, keepdims=True)
        rows = [np.hstack([jacobian, -shift[:, None] / length]), weight**0.5 * np.eye(1, len(lower) + 1, len(lower))]
        stacked = np.vstack([*rows, np.hstack([weight**0.5 * matrix[e:], np.zeros((len(lower), 1))])])
        wanted = [np.zeros(e), weight**0.5 * length, weight**0.5 * goal[e:]]
        theirs = minimum(stacked, np.concatenate(wanted), np.append(lower, 0.0), np.append(upper, length))[:-1]
        np.testing.assert_allclose(solution.qdot[i], theirs, rtol=0, atol=1e-5 * np.abs(theirs).max())


@pytest.mark.parametrize(("name", "parameters"), [("qp", {"task_scaling": True}), ("sns", {})])
def test_scaling_stays_on_a_path_within_all_limits(name, parameters):
    episode = played(circle("tiago", dt=4e-3), name, **parameters)
    assert episode.position_error.max() < 5e-5
    assert not episode.at_limit.any()
    assert (episode.status == Status.APPLIED).all()


@pytest.mark.parametrize(
    ("scenario", "name", "parameters"),
    [
        *((beyond_reach(), name, {}) for name in ("qp", "sns")),
        (circle(radius=0.15, speed=2.5, acceleration=40.0), "qp", {"task_scaling": True}),
    ],
)
def test_no_limit_is_met_off_the_path(scenario, name, parameters):
    """Beyond the reach, and above the velocity limits."""
    episode = played(scenario, name, **parameters)
    assert episode.position_error.max() > 0.02
    assert not episode.at_limit.any()
    assert {*episode.status} == {Status.APPLIED, Status.SATURATED}


def test_braking_comes_back_to_a_lost_reference_without_swinging():
    scenario = circle(radius=0.15, speed=2.5, acceleration=40.0, wait=0.5).replace(steps=1500)
    braking, dead_beat = (played(scenario, braking_share=share).position_error for share in (0.5, 0.0))
    assert braking.max() < 0.9 * dead_beat.max()
    assert braking[-1] < 1e-5
    assert dead_beat[-1] > 1e-2


def test_the_posture_is_approached_in_motion_and_left_alone_at_rest():
    scenario = circle()
    posture = scenario.arm.home + 0.2 * np.eye(7)[0]
    still = ikgym.trajectories.Sinusoid(np.zeros(7), offset=scenario.arm.home)
    rest = scenario.replace(trajectory=still, start=None, steps=100)
    assert np.abs(played(rest, posture=tuple(posture)).qdot).max() < 1e-6
    led, free = (played(scenario, posture=tuple(posture), secondary_gain=gain) for gain in (None, 0.0))
    assert led.position_error.max() < 1e-6
    assert np.linalg.norm(led.q[-1] - posture) < np.linalg.norm(free.q[-1] - posture) - 0.01
