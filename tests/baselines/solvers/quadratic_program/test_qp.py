"""The policy `qp` against SciPy's solution of the program that it states, and in motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog, lsq_linear

import baselines
import ikgym
from baselines.policy import Batch
from baselines.solvers.quadratic_program.limits import limits_with_braking
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


def rotation_rows(task, e):
    """The components of an error that belong to the rotation."""
    return {"position": slice(0, 0), "pose": slice(3, 6), "axis": slice(3, 5)}.get(task, slice(0, e - 3))


def program(policy, batch, memory, i):
    """The least squares of the docstring, for row i, without braking: matrix, goal, bounds, J Δt and Δx."""
    problem, model = policy.problem, policy.problem.model
    rotation, _, geometric = model.forward_and_jacobian(batch.q[i])
    jacobian = problem.dt * problem.task.jacobian(rotation, geometric)
    error = policy.gain * problem.task.error(memory.nominal[i], batch.pose[i])
    shift = problem.task.error(batch.nominal[i, 0], memory.nominal[i]) + error
    rotation = rotation_rows(problem.task.name, len(error))
    for rows in (jacobian, error, shift):
        rows[rotation] *= policy.rotation_weight
    rho = policy.damping * np.sum(jacobian**2) / model.joints
    rho += policy.lm_damping * (error @ error) / problem.largest_qdot.max() ** 2
    lower, upper = np.empty(model.joints), np.empty(model.joints)
    velocity_box(limits_with_braking(problem), problem.dt, batch.q[i], batch.qdot[i], lower, upper)
    posture = np.zeros(model.joints) if policy.posture is None else np.asarray(policy.posture)
    root = np.sqrt(rho) * np.eye(model.joints)
    matrix = np.vstack([jacobian, root])
    goal = np.concatenate([shift, root @ (policy.secondary_gain * (posture - batch.q[i]))])
    return matrix, goal, (lower, upper), jacobian, shift


SCENARIOS = {
    "panda": circle(),
    "tiago": circle("tiago", dt=4e-3),
    "fetch": circle("fetch", dt=4e-3),
    "axis": circle(task=ikgym.tasks.get("axis")),
    "some limits": limited(),
    "no limits": ikgym.scenarios.get("varga7-fast"),
    "matrix": ikgym.scenarios.get("khan8-q1"),
}


@pytest.mark.parametrize("far", [0.3, 3.0])
@pytest.mark.parametrize("on", SCENARIOS)
def test_is_the_minimum_that_it_states(on, far):
    scenario, bound = SCENARIOS[on], 0
    policy = baselines.make(
        "qp", scenario, damping=1e-3, lm_damping=1e-2, posture=0.3, secondary_gain=2.0, gain=0.7, braking_share=0.0
    )
    batch, memory = states(scenario, 40, far)
    solution = policy.solve(batch, memory)
    for i in range(40):
        matrix, goal, (lower, upper), *_ = program(policy, batch, memory, i)
        fixed = lower == upper  # which SciPy refuses
        theirs = lsq_linear(
            matrix, goal, (lower - fixed * 1e-13, upper + fixed * 1e-13), method="bvls", tol=1e-15, max_iter=1000
        ).x
        ours = solution.qdot[i]
        assert ((lower <= ours) & (ours <= upper)).all()
        bound += ((ours == lower) | (ours == upper)).any()
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6 * np.abs(theirs).max())
    assert on in ("no limits", "matrix") or bound > 15


@pytest.mark.parametrize("on", ["panda", "axis", "some limits", "matrix", "position"])
def test_rotation_is_weighed_as_stated(on):
    position = {"position": circle(task=ikgym.tasks.get("position"))}
    scenario, apart = {**SCENARIOS, **position}[on], 0.0
    policy = baselines.make("qp", scenario, rotation_weight=0.2, damping=1e-3, posture=0.3, braking_share=0.0)
    batch, memory = states(scenario, 20, 3.0)
    solution, equal = policy.solve(batch, memory), policy.replace(rotation_weight=1.0).solve(batch, memory)
    for i in range(20):
        matrix, goal, (lower, upper), *_ = program(policy, batch, memory, i)
        fixed = 1e-13 * (lower == upper)
        theirs = lsq_linear(matrix, goal, (lower - fixed, upper + fixed), **BVLS).x
        np.testing.assert_allclose(solution.qdot[i], theirs, rtol=0, atol=1e-6 * np.abs(theirs).max())
        apart = max(apart, np.abs(solution.qdot[i] - equal.qdot[i]).max())
    assert apart == 0.0 if on == "position" else apart > 1e-3


def test_the_less_rotation_weighs_the_nearer_is_the_position():
    """On a path that leads out of reach, where position and rotation are at odds."""
    scenario = beyond_reach()
    far = [
        played(scenario, baselines.make("qp", scenario, rotation_weight=weight))[0].max() for weight in (1.0, 0.1, 0.01)
    ]
    assert far[0] > 1.1 * far[1] > 1.1**2 * far[2]


@pytest.mark.parametrize("on", ["panda", "tiago", "no limits"])
def test_scaling_is_the_minimum_that_it_states(on):
    scenario = SCENARIOS[on]
    policy = baselines.make("qp", scenario, task_scaling=True, damping=1e-2, posture=0.3, braking_share=0.0)
    batch, memory = states(scenario, 40, 4.0, seed=2)
    solution = policy.solve(batch, memory)
    for i in range(40):
        matrix, goal, (lower, upper), jacobian, shift = program(policy, batch, memory, i)
        weight, e = 1e-2, len(shift)
        length = np.linalg.norm(shift, keepdims=True)
        rows = [np.hstack([jacobian, -shift[:, None] / length]), weight**0.5 * np.eye(1, len(lower) + 1, len(lower))]
        stacked = np.vstack([*rows, np.hstack([weight**0.5 * matrix[e:], np.zeros((len(lower), 1))])])
        wanted = [np.zeros(e), weight**0.5 * length, weight**0.5 * goal[e:]]
        lower, upper = np.append(lower - (lower == upper) * 1e-13, 0.0), np.append(upper, length)
        theirs = lsq_linear(stacked, np.concatenate(wanted), (lower, upper), **BVLS).x[:-1]
        np.testing.assert_allclose(solution.qdot[i], theirs, rtol=0, atol=1e-5 * np.abs(theirs).max())


@pytest.mark.parametrize("on", ["panda", "tiago"])
def test_scaling_keeps_the_direction_and_makes_the_most_of_it(on):
    """Against a linear program: the largest s for which the bounds allow s Δx."""
    scenario, scaled = SCENARIOS[on], 0
    policy = baselines.make("qp", scenario, task_scaling=True, secondary_gain=0.0, braking_share=0.0)
    batch, memory = states(scenario, 100, 4.0, seed=2)
    batch.qdot[:] *= 0.03  # so that any direction can be made within a step
    solution = policy.solve(batch, memory)
    for i in range(100):
        _, _, bounds, jacobian, shift = program(policy, batch, memory, i)
        n, length = len(solution.qdot[i]), np.linalg.norm(shift)
        columns = np.hstack([jacobian, -shift[:, None]]) / length
        most = linprog(
            -np.eye(n + 1)[n], A_eq=columns, b_eq=np.zeros(6), bounds=[*zip(*bounds, strict=True), (0.0, 1.0)]
        )
        if not most.success or most.x[n] < 1e-3:
            continue
        made = jacobian @ solution.qdot[i]
        s = made @ shift / length**2
        assert np.linalg.norm(made - s * shift) < (0.1 * (1.0 - most.x[n]) + 1e-3) * length
        assert s > 0.99 * most.x[n]
        scaled += most.x[n] < 0.95
    assert scaled > 5


def test_without_limits_it_is_damped_least_squares():
    scenario = ikgym.scenarios.get("varga7-pose-random")
    policy = baselines.make("qp", scenario)
    batch, memory = states(scenario, 20, 0.1)
    solution = policy.solve(batch, memory)
    assert (solution.iterations == 1).all()
    for i in range(20):
        matrix, goal, *_ = program(policy, batch, memory, i)
        wanted = np.linalg.lstsq(matrix, goal * (np.arange(len(goal)) < 6), rcond=None)[0]  # no posture
        np.testing.assert_allclose(solution.qdot[i], wanted, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(("arm", "dt", "bar"), [("panda", 1e-3, 1e-5), ("tiago", 4e-3, 5e-5), ("gen3", 1e-3, 1e-5)])
@pytest.mark.parametrize("scaling", [False, True])
def test_stays_on_a_path_within_all_limits(arm, dt, bar, scaling):
    scenario = circle(arm, dt)
    errors, _, held, statuses = played(scenario, baselines.make("qp", scenario, task_scaling=scaling))
    assert errors.max() < bar
    assert held == [0, 0, 0]
    assert (statuses == Status.APPLIED).all()


@pytest.mark.parametrize("scaling", [False, True])
@pytest.mark.parametrize("scenario", [beyond_reach(), circle(radius=0.15, speed=2.5, acceleration=40.0)])
def test_no_limit_is_met_off_the_path(scenario, scaling):
    """Beyond the reach, and above the velocity limits."""
    errors, _, held, statuses = played(scenario, baselines.make("qp", scenario, task_scaling=scaling))
    assert errors.max() > 0.02
    assert held == [0, 0, 0]
    assert set(statuses) == {Status.APPLIED, Status.SATURATED}


def test_no_limit_is_met_from_anywhere():
    """From random postures and from stops, towards a reference that is far away."""
    scenario = circle(wait=0.0).replace(steps=200)
    policy, rng, arm = baselines.make("qp", scenario), np.random.default_rng(5), scenario.arm
    for k in range(0, 12, 2):
        q = rng.uniform(arm.lower, arm.upper)
        q = np.where(rng.random(7) < 0.1 * k, rng.choice([arm.lower, arm.upper]), q)
        assert played(scenario, policy, q)[2] == [0, 0, 0]


def test_braking_comes_back_to_a_lost_reference_without_swinging():
    scenario = circle(radius=0.15, speed=2.5, acceleration=40.0, wait=0.5)
    scenario = scenario.replace(steps=1500)
    braking, dead_beat = (played(scenario, baselines.make("qp", scenario, braking_share=share)) for share in (0.5, 0.0))
    assert braking[0].max() < 0.9 * dead_beat[0].max()
    assert braking[0][-1] < 1e-5
    assert dead_beat[0][-1] > 1e-2


def rests_at(scenario, **parameters):
    """Where the joints go while the tool stands."""
    n = scenario.joints
    still = scenario.replace(trajectory=ikgym.trajectories.Sinusoid(np.zeros(n), offset=scenario.arm.home), start=None)
    policy = baselines.make("qp", still, **parameters)
    env = ikgym.RedundantIKEnv(still)
    seen, _ = env.reset()
    start, state = seen["q"], None
    for _ in range(200):
        action, state = policy.predict(seen, state)
        seen, *_, info = env.step(action)
        assert info["position_error"] < 1e-6
    return start, seen["q"]


def test_the_null_space_leads_to_a_posture():
    scenario = circle().replace(steps=200)
    start, end = rests_at(scenario)  # at home
    np.testing.assert_allclose(end, start, rtol=0, atol=1e-7)
    goal = start + np.array([0.2, 0, 0, 0, 0, 0, 0])
    assert np.linalg.norm(rests_at(scenario, posture=tuple(goal))[1] - goal) < 0.995 * np.linalg.norm(start - goal)
    _, still = rests_at(scenario, posture=tuple(goal), secondary_gain=0.0)
    np.testing.assert_allclose(still, start, rtol=0, atol=1e-7)
