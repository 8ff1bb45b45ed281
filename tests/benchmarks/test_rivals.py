"""Other people's solvers see the same problem, and find its optimum."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import ikgym
from baselines.policy import Problem
from benchmarks.rivals.casadi_horizon import CasadiHorizon
from benchmarks.rivals.numpy_horizon import Horizon, plan_cost
from ikgym import TrackingCost
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from tests.baselines.solvers.receding_horizon.data import data_of, horizon_cost


def problem_of(arm: Arm, task: str = "skew", **cost: float) -> Problem:
    return Problem(arm, ikgym.tasks.get(task), TrackingCost(**cost), 1e-3, np.full(arm.joints, 20.0))


def random_horizon(problem: Problem, knots: int, seed: int = 0, far: float = 1.0) -> tuple[Horizon, np.ndarray]:
    """A start, a path that can be tracked from near it, and any plan, all within a few steps of one another."""
    rng = np.random.default_rng(seed)
    n = problem.model.joints
    q = rng.uniform(-1.0, 1.0, n)
    path = q + np.cumsum(rng.normal(0.0, 1e-3, (knots, n)) + 1e-3, axis=0)
    nominal = problem.task.coordinates(*problem.model.forward(path))
    return Horizon(q + far * rng.normal(0.0, 1e-3, n), nominal), path + rng.normal(0.0, 2e-4, path.shape)


#: All tasks with one arm, and one task with each arm: a product of both says nothing more.
PAIRS = [*(("varga7", task) for task in ikgym.tasks.names()), *((name, "pose") for name in ikgym.arms.names())]


@pytest.mark.parametrize(("arm", "task"), PAIRS)
def test_numpy_cost_is_that_of_the_kernels(arm, task):
    problem = problem_of(ikgym.arms.get(arm), task, p_x=3.5, p_in=2.0)
    horizon, plan = random_horizon(problem, 4)
    qdot = np.diff(np.vstack([horizon.q, plan]), axis=0) / problem.dt
    kernels = horizon_cost(data_of(problem), horizon.q, horizon.nominal, qdot)
    assert plan_cost(problem, horizon, plan) == pytest.approx(kernels, rel=1e-9)


@pytest.mark.parametrize(("arm", "task"), PAIRS)
def test_symbols_are_of_the_same_arm(arm, task):
    arm = ikgym.arms.get(arm)
    problem = problem_of(arm, task)
    residual = CasadiHorizon(problem, 1)._residual
    rng = np.random.default_rng(0)
    # Near and far: the rotation vector has a series for small angles.
    for far in (0.0, 1e-4, 0.01, 0.5):
        q = rng.uniform(-1.0, 1.0, arm.joints)
        pose, goal = (problem.task.coordinates(*arm.forward(p)) for p in (q, q + far * rng.uniform(size=arm.joints)))
        symbols = problem.cost.delta_x * np.array(residual(q, goal))[:, 0]
        np.testing.assert_allclose(symbols, problem.task.error(goal, pose), atol=1e-12)


def test_lengths_and_weights_count():
    problem = problem_of(ikgym.arms.get("varga7"))
    fine, plan = random_horizon(problem, 4)
    # Two steps at one speed, the first one's tracking not counted, are one step of twice the length.
    plan[0], plan[2] = (fine.q + plan[1]) / 2, (plan[1] + plan[3]) / 2
    weights = np.array([0.0, 2.0, 0.0, 3.0])
    coarse = Horizon(fine.q, fine.nominal[1::2], np.array([2.0, 2.0]), weights[1::2])
    whole = plan_cost(problem, Horizon(fine.q, fine.nominal, weights=weights), plan)
    assert plan_cost(problem, coarse, plan[1::2]) == pytest.approx(whole, rel=1e-12)
    best = CasadiHorizon(problem, 2).solve(coarse)
    assert best.converged
    assert best.cost <= whole
    assert multiplier_gap(problem, coarse, best.q) < 1e-4


@pytest.mark.parametrize(("arm_name", "task"), [("varga7", "skew"), ("khan8", "pose"), ("faitli3", "position")])
def test_optimum_satisfies_its_conditions(arm_name, task):
    problem = problem_of(ikgym.arms.get(arm_name), task)
    horizon, plan = random_horizon(problem, 3)
    best = CasadiHorizon(problem, 3).solve(horizon)
    assert best.converged
    assert best.cost <= plan_cost(problem, horizon, plan)
    assert multiplier_gap(problem, horizon, plan) > 1.0
    assert multiplier_gap(problem, horizon, best.q) < 1e-4


@pytest.mark.parametrize("p_x", [2.0, 4.0])
def test_other_exponents(p_x):
    problem = problem_of(ikgym.arms.get("varga7"), p_x=p_x, p_in=2.0, p_out=2.0)
    horizon, plan = random_horizon(problem, 2)
    best = CasadiHorizon(problem, 2).solve(horizon, plan)
    assert best.converged
    assert multiplier_gap(problem, horizon, best.q) < 1e-4


@pytest.mark.parametrize("cost", [{"p_x": 1.5}, {"p_x": 2.5}, {"p_in": 2.0}, {"p_in": 3.0, "p_out": 3.0}])
def test_exponents_without_a_smooth_form_are_refused(cost):
    with pytest.raises(InvalidInputError, match="expected"):
        CasadiHorizon(problem_of(ikgym.arms.get("varga7"), **cost), 2)


def multiplier_gap(problem: Problem, horizon: Horizon, q: np.ndarray) -> float:
    """How far 0 is from the subdifferential of the cost by y = q / Δt; slopes are free at the kinks of Φ^X."""
    cost, h = problem.cost, horizon.lengths
    knots, n = q.shape
    qdot = np.diff(np.vstack([horizon.q, q]), axis=0) / (h[:, None] * problem.dt)
    slope = cost.velocity_gradient(qdot)
    total = slope - np.vstack([slope[1:], np.zeros(n)])
    kinks = []
    for k in range(knots):
        rotation, position, geometric = problem.model.forward_and_jacobian(q[k])
        here = problem.task.coordinates(rotation, position)
        task_jacobian = problem.task.jacobian(rotation, geometric)
        jacobian = problem.dt * problem.task.error_jacobian(horizon.nominal[k], here, task_jacobian)
        error = problem.task.error(horizon.nominal[k], here)
        for j, by_error in enumerate(cost.tracking_gradient(error)):
            row = horizon.tracking_weights[k] * jacobian[j]
            if abs(abs(error[j]) / cost.delta_x - 1.0) < 1e-6:
                column = np.zeros((knots, n))
                column[k] = row * np.sign(error[j]) / cost.delta_x
                kinks.append(column.ravel())
            else:
                total[k] += by_error * row
    if not kinks:
        return float(np.abs(total).max())
    low, high = sorted((2.0, cost.p_x)) if cost.p_x != 2.0 else (2.0, 2.0 + 1e-9)
    return float(np.abs(lsq_linear(np.array(kinks).T, -total.ravel(), (low, high)).fun).max())
