"""Newton steps by blocks against a dense solve, and minima that can be found by hand."""

import math

import numpy as np
import pytest

import ikgym
from baselines.solvers.receding_horizon.newton.cost import true_cost
from baselines.solvers.receding_horizon.newton.minimise import CONVERGED, NewtonSettings, minimise
from baselines.solvers.receding_horizon.newton.newton_step import newton_step, pentadiagonal_step
from baselines.solvers.receding_horizon.newton.workspace import PathProblem, newton_workspace
from ikgym import TrackingCost
from ikgym.arms import Arm
from ikgym.kernels import tasks as task_kernels
from tests.baselines.solvers.receding_horizon.data import joint_weights
from tests.baselines.solvers.receding_horizon.newton.problems import UNLIMITED, grid_of, model_tuple
from tests.baselines.solvers.receding_horizon.newton.test_cost import dense


def random_blocks(knots, n, rng, convex=True):
    blocks = newton_workspace(task_kernels.POSITION, 3, knots, n).model
    blocks.gradient[:] = rng.normal(size=(knots, n))
    half = rng.normal(size=(2, knots, n, n))
    blocks.diagonal[:] = half[0] @ half[0].swapaxes(1, 2)
    blocks.second[:] = 0.1 * (half[1] + half[1].swapaxes(1, 2))
    blocks.coupling[:] = rng.uniform(0.1, 3.0, (knots, n))
    for k in range(knots):
        here = blocks.coupling[k] + (blocks.coupling[k + 1] if k + 1 < knots else 0.0)
        blocks.diagonal[k] += np.diag(here + (2.0 if convex else -4.0))
        blocks.diagonal[k][np.triu_indices(n, 1)] = np.nan  # of no use, and never read
        blocks.second[k][np.triu_indices(n, 1)] = np.nan
    return blocks


def step_of(blocks, exact, damping, solve=newton_step):
    knots, n = blocks.gradient.shape
    inverse, factor, step = np.empty((knots, n, n)), np.empty((n, n)), np.empty((knots, n))
    return solve(blocks, exact, damping, inverse, factor, step), step


@pytest.mark.parametrize("solve", [newton_step, pentadiagonal_step])
@pytest.mark.parametrize(("exact", "damping"), [(False, 0.0), (True, 0.7)])
@pytest.mark.parametrize(("knots", "n"), [(1, 7), (2, 3), (3, 2), (30, 8)])
def test_step_against_a_dense_solve(knots, n, exact, damping, solve):
    blocks = random_blocks(knots, n, np.random.default_rng(knots))
    blocks.far[:] = np.random.default_rng(0).uniform(-0.4, 0.4, (knots, n))
    good, step = step_of(blocks, exact, damping, solve)
    assert good
    matrix = dense(blocks, second=exact, far=solve is pentadiagonal_step) + damping * np.eye(knots * n)
    np.testing.assert_allclose(step.ravel(), np.linalg.solve(matrix, -blocks.gradient.ravel()), atol=1e-11)


@pytest.mark.parametrize("knots", [1, 4])
def test_what_is_not_convex_is_refused_and_damped(knots):
    blocks = random_blocks(knots, 3, np.random.default_rng(0), convex=False)
    least = np.linalg.eigvalsh(dense(blocks, second=False))[0]
    assert least < 0.0
    assert not step_of(blocks, False, -0.99 * least)[0]
    assert step_of(blocks, False, -1.01 * least)[0]
    blocks.gradient[:] = blocks.diagonal[:] = np.nan
    assert not step_of(blocks, False, 0.0)[0]


# One joint that slides along x, both powers 2 for velocities, Δx = Δt Δq̇ = s: with y = (q - q_0) / s and the goal at d,
# the cost is φ(d - y) + y², where φ is a square within 1 and a cube beyond.
S = 1e-3


def slider(goals, weight=1.0, upper=np.inf, speed=np.inf, most=50, tolerance=1e-12):
    arm = Arm("slider", np.zeros((1, 3)), [[1.0, 0.0, 0.0]], (True,))
    task = ikgym.tasks.get("position")
    cost = TrackingCost(delta_x=S, p_x=3.0, delta_qdot=1.0, p_out=2.0, p_in=2.0)
    data = model_tuple(arm, task, cost, S, np.array([[-np.inf], [upper * S], [speed]]))
    goals = np.atleast_1d(goals)
    grid = grid_of(range(1, len(goals) + 1), terminal=weight)
    nominal = np.zeros((len(goals), 3))
    nominal[:, 0] = goals * S
    path, multipliers = np.zeros((len(goals), 1)), np.zeros((len(goals), 5))
    workspace = newton_workspace(task.kind, task.size, len(goals), 1)
    problem = PathProblem(data, grid, np.zeros(1), nominal, joint_weights(1), change_limit=UNLIMITED)
    settings = NewtonSettings(True, most, tolerance)
    outcome, made, value, slope = minimise(problem, path, multipliers, settings, workspace)
    true = true_cost(problem, path, workspace)
    return path[:, 0] / S, multipliers, outcome, made, value, slope, true


@pytest.mark.parametrize(
    ("goal", "weight", "wanted", "multiplier"),
    [
        (1.5, 1.0, 0.75, None),  # inside the kink: 2 (d - y) = 2 y
        (2.2, 1.0, 1.2, 0.4),  # on it: the slope 2 y lies between 2 and 3
        (-2.2, 1.0, -1.2, -0.4),
        (2.4, 1.0, 1.4, 0.8),
        (3.5, 2.0, 2.5, 0.5),  # twice the weight: 2 y between 4 and 6
        (4.0, 1.0, 4.0 - (math.sqrt(25.0) - 1.0) / 3.0, 1.0),  # beyond: 3 r² = 2 (d - r)
    ],
)
def test_minimum_on_a_kink_by_hand(goal, weight, wanted, multiplier):
    y, multipliers, outcome, made, value, slope, true = slider(goal, weight)
    assert outcome == CONVERGED
    assert made < 30
    assert y[0] == pytest.approx(wanted, abs=1e-6)
    assert multiplier is None or multipliers[0, 0] == pytest.approx(multiplier, abs=1e-5)
    assert value == pytest.approx(true, rel=1e-9)
    assert slope * S < 1e-5


@pytest.mark.parametrize(("kind", "place", "unit"), [("upper", 4, 1.0 / S), ("speed", 3, 1.0)])
@pytest.mark.parametrize("goal", [1.6, 2.2, 4.0])
def test_minimum_on_a_limit_by_hand(goal, kind, place, unit):
    y, multipliers, outcome, made, *_ = slider(goal, **{kind: 0.5}, tolerance=1e-9)
    assert outcome == CONVERGED
    assert made < 30
    rest = goal - 0.5
    force = (2.0 * rest if rest < 1.0 else 3.0 * rest**2) - 1.0
    assert y[0] == pytest.approx(0.5, rel=1e-5)
    assert multipliers[0, place] == pytest.approx(force * unit, rel=1e-4)


def test_limits_of_two_knots_by_hand():
    """The second knot is as near the goal as two steps at the limit lead."""
    y, _, outcome, *_ = slider([0.0, 6.0], speed=2.0, tolerance=1e-9)
    assert outcome == CONVERGED
    np.testing.assert_allclose(y[1] - y[0], 2.0, rtol=1e-5)


@pytest.mark.parametrize("goal", [3.0, 10.0, 30.0])
def test_multipliers_are_not_renewed_twice_at_one_path(goal):
    """Each time they would go one ρ further, past what holds the limit: they would oscillate without end."""
    y, _, outcome, *_ = slider(goal, speed=5.0, most=100, tolerance=1e-7)
    assert outcome == CONVERGED
    assert y[0] <= 5.0 * (1.0 + 1e-6)
