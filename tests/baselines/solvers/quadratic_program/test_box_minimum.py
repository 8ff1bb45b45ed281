"""The minimum in a box against the optimality conditions."""

import numpy as np
import pytest

from baselines.solvers.quadratic_program.box_minimum import box_minimum


def random_problem(rng, kind):
    """Rows and goal of a least-squares problem with its bounds: ‖A x - b‖², A of full column rank."""
    n, e = rng.integers(1, 10), rng.integers(1, 8)
    rows = rng.normal(size=(e, n)) * 10 ** rng.uniform(-2, 1)
    if kind == "parallel rows":
        rows[-1] = rows[0]
    if kind == "parallel columns":
        rows[:, -1] = rows[:, 0]
    matrix = np.vstack([rows, 10 ** rng.uniform(-3, 0) * np.abs(rows).max() * np.eye(n)])
    goal = np.concatenate([rng.normal(size=e) * 10 ** rng.uniform(-3, 3), rng.normal(size=n)])
    lower, upper = -rng.uniform(0, 1, n), rng.uniform(0, 1, n)
    if kind == "away from 0":
        lower = rng.normal(size=n)
        upper = lower + rng.uniform(0, 0.1, n)
    if kind == "fixed":
        fixed = rng.random(n) < 0.3
        lower[fixed] = upper[fixed] = rng.normal(size=fixed.sum())
    if kind == "at a bound":  # the unconstrained minimum is at bounds, whose multipliers are 0
        goal = matrix @ np.clip(rng.normal(size=n), lower, upper)
    if kind == "one-sided":
        lower[rng.random(n) < 0.5] = -np.inf
        upper[rng.random(n) < 0.5] = np.inf
    return matrix, goal, lower, upper


def solved(matrix, goal, lower, upper):
    x = np.full(matrix.shape[1], np.nan)
    return x, *box_minimum(matrix.T @ matrix, matrix.T @ goal, lower, upper, x)


KINDS = ["plain", "parallel rows", "parallel columns", "away from 0", "fixed", "at a bound", "one-sided"]


@pytest.mark.parametrize("kind", KINDS)
def test_meets_the_optimality_conditions(kind):
    rng, bound = np.random.default_rng(KINDS.index(kind)), 0
    for _ in range(300):
        matrix, goal, lower, upper = random_problem(rng, kind)
        x, solves, found = solved(matrix, goal, lower, upper)
        assert found
        assert 1 <= solves <= 3 * len(x) + 2
        assert ((lower <= x) & (x <= upper)).all()
        hessian, linear = matrix.T @ matrix, matrix.T @ goal
        slope = (hessian @ x - linear) / (np.abs(hessian) @ np.abs(x) + np.abs(linear))
        free, fixed = (lower < x) & (x < upper), lower == upper
        assert np.abs(slope[free]).max(initial=0.0) < 1e-11
        assert slope[(x == lower) & ~fixed].min(initial=0.0) > -1e-11
        assert slope[(x == upper) & ~fixed].max(initial=0.0) < 1e-11
        bound += (~free & ~fixed).any()
    assert bound > 100


def test_a_variable_that_was_bound_too_early_is_released():
    """Cut to the box, the unconstrained minimum has both variables at bounds, and only one of them belongs there."""
    hessian, linear = np.array([[1.0, 0.9], [0.9, 1.0]]), np.array([2.0, 0.5])
    x = np.empty(2)
    assert np.linalg.solve(hessian, linear)[1] < -1.0
    assert box_minimum(hessian, linear, np.full(2, -1.0), np.ones(2), x) == (3, True)
    np.testing.assert_allclose(x, [1.0, -0.4], rtol=1e-12)


@pytest.mark.parametrize("matrix", [np.zeros((2, 2)), np.diag([1.0, -1.0]), np.full((2, 2), np.nan)])
def test_no_minimum_is_no_minimum(matrix):
    x = np.empty(2)
    solves, found = box_minimum(matrix, np.ones(2), -np.ones(2), np.ones(2), x)
    assert (solves, found) == (1, False)
    assert x.tolist() == [0.0, 0.0]
