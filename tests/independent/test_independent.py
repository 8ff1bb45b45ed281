"""Other people's solvers see the same problem, and find its optimum."""

import dataclasses

import numpy as np
import pytest

import ikgym
from baselines.policy import Problem
from ikgym import TrackingCost
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from tests.baselines.solvers.receding_horizon.data import data_of, horizon_cost, joint_weights
from tests.independent.casadi_horizon import CasadiHorizon
from tests.independent.casadi_kinematics import residual
from tests.independent.numpy_horizon import Horizon, plan_cost


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
def test_the_cost_is_that_of_the_kernels(arm, task):
    problem = problem_of(ikgym.arms.get(arm), task, p_x=3.5, p_in=2.0)
    horizon, plan = random_horizon(problem, 4)
    horizon = dataclasses.replace(horizon, joint_weights=joint_weights(problem.model.joints))
    qdot = np.diff(np.vstack([horizon.q, plan]), axis=0) / problem.dt
    kernels = horizon_cost(data_of(problem), horizon.q, horizon.nominal, qdot)
    assert plan_cost(problem, horizon, plan) == pytest.approx(kernels, rel=1e-9)


@pytest.mark.parametrize(("arm", "task"), PAIRS)
def test_symbols_are_of_the_same_arm(arm, task):
    arm = ikgym.arms.get(arm)
    problem = problem_of(arm, task)
    rng = np.random.default_rng(0)
    # Near and far: the rotation vector has a series for small angles.
    for far in (0.0, 1e-4, 0.01, 0.5):
        q = rng.uniform(-1.0, 1.0, arm.joints)
        pose, goal = (problem.task.coordinates(*arm.forward(p)) for p in (q, q + far * rng.uniform(size=arm.joints)))
        symbols = problem.cost.delta_x * np.array(residual(problem)(q, goal))[:, 0]
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


@pytest.mark.parametrize("cost", [{"p_x": 1.5}, {"p_x": 2.5}, {"p_in": 2.0}, {"p_in": 3.0, "p_out": 3.0}])
def test_exponents_without_a_smooth_form_are_refused(cost):
    with pytest.raises(InvalidInputError, match="expected"):
        CasadiHorizon(problem_of(ikgym.arms.get("varga7"), **cost), 2)
