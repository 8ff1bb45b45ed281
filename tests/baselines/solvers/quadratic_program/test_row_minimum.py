"""The minimum in a box under rows against quadprog, and against a linear programme where there is none."""

import numpy as np
import pytest
import quadprog
from scipy.optimize import linprog

from baselines.solvers.quadratic_program.row_minimum import row_minimum

KINDS = ["plain", "stiff", "parallel rows", "fixed", "degenerate", "no rows"]


def random_problem(rng, kind):
    """H, g, bounds, and rows that some x in the box has."""
    n, m = rng.integers(1, 10), 0 if kind == "no rows" else rng.integers(1, 17)
    task = rng.normal(size=(rng.integers(1, 7), n)) * 10 ** rng.uniform(-2, 1)
    least = -7 if kind == "stiff" else -4
    hessian = task.T @ task + 10 ** rng.uniform(least, 0) * np.trace(task.T @ task) / n * np.eye(n)
    linear = hessian @ rng.normal(size=n) * 10 ** rng.uniform(-1, 1)
    lower, upper, rows = -rng.uniform(0, 1, n), rng.uniform(0, 1, n), rng.normal(size=(m, n))
    if kind == "fixed":
        fixed = rng.random(n) < 0.3
        lower[fixed] = upper[fixed] = rng.normal(size=fixed.sum())
    if kind == "parallel rows" and m > 2:
        rows[1], rows[2] = rows[0], 3.0 * rows[0] + 1e-9 * rng.normal(size=n)
    room = 0.0 if kind == "degenerate" else 0.3 * rng.exponential(size=m)  # all rows are met in one point
    return hessian, linear, lower, upper, rows, rows @ rng.uniform(lower, upper) - room


def solved(hessian, linear, lower, upper, rows, bounds):
    x, bounds = np.full(len(linear), np.nan), bounds.copy()
    steps, found = row_minimum(hessian, linear, lower, upper, rows, bounds, len(bounds), x)
    return x, steps, found, bounds


@pytest.mark.parametrize("kind", KINDS)
def test_agrees_with_quadprog(kind):
    rng, active, refused = np.random.default_rng(KINDS.index(kind)), 0, 0
    for _ in range(300):
        hessian, linear, lower, upper, rows, bounds = random_problem(rng, kind)
        x, _, found, kept = solved(hessian, linear, lower, upper, rows, bounds)
        assert found
        assert np.array_equal(kept, bounds)
        assert ((lower <= x) & (x <= upper)).all()
        assert (rows @ x - bounds).min(initial=0.0) > -1e-10 * max(1.0, np.abs(bounds).max(initial=0.0))
        normals = np.hstack([np.eye(len(x)), -np.eye(len(x)), rows.T])
        try:
            theirs = quadprog.solve_qp(hessian, linear, normals, np.concatenate([lower, -upper, bounds]))[0]
        except ValueError:  # it takes some degenerate programmes for infeasible
            refused += 1
            continue
        cost, least = (0.5 * y @ hessian @ y - linear @ y for y in (x, theirs))
        assert cost - least < 1e-8 * (abs(cost) + abs(least))
        active += (rows @ x - bounds < 1e-9).any()
    assert kind == "no rows" or active > 60
    assert refused < 60


def test_lowers_rows_that_contradict_each_other_by_the_least_amount():
    rng, contradictions = np.random.default_rng(4), 0
    for _ in range(100):
        hessian, linear, lower, upper, rows, bounds = random_problem(rng, "plain")
        bounds += rng.exponential(size=len(bounds))
        reach = np.maximum(rows * lower, rows * upper).sum(axis=1)
        wanted = np.minimum(bounds, reach)
        x, _, found, kept = solved(hessian, linear, lower, upper, rows, bounds)
        sides = np.hstack([-rows, -np.ones((len(rows), 1))])
        least = linprog(np.eye(len(x) + 1)[-1], sides, -wanted, bounds=[*zip(lower, upper, strict=True), (0, None)]).fun
        assert found
        assert ((lower <= x) & (x <= upper)).all()
        assert (rows @ x - kept).min() > -1e-10 * max(1.0, np.abs(bounds).max())
        if not np.array_equal(kept, bounds):
            np.testing.assert_allclose(wanted - kept, least, rtol=0, atol=1e-6)
            contradictions += 1
        else:
            assert least < 1e-9
    assert contradictions > 40


def test_a_matrix_that_is_not_positive_definite_leads_nowhere():
    x = np.empty(2)
    found = row_minimum(-np.eye(2), np.ones(2), -np.ones(2), np.ones(2), np.zeros((1, 2)), np.zeros(1), 0, x)[1]
    assert not found
    assert (np.abs(x) <= 1.0).all()
