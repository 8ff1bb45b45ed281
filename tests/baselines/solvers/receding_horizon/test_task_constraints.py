"""Task coordinates as unknowns of a horizon, against eq. 3-4 in plain NumPy and against the plain method."""

import numpy as np
import pytest

from baselines.solvers.receding_horizon.horizon import analytic_gradient
from baselines.solvers.receding_horizon.task_constraints import (
    Unknowns,
    analytic_task_gradient,
    difference_task_gradient,
    reduce_task_gradient,
    reduced_task_gradient,
)
from tests.baselines.solvers.receding_horizon.data import constraints, problem, reduced_by_hand, with_tasks


@pytest.mark.parametrize("stages", [1, 5])
@pytest.mark.parametrize("name", ["varga7-fast", "zhang3-helix"])
def test_gradient_with_task_coordinates(name, stages):
    """On the constraints the derivatives along them are the plain ones, by the chain rule."""
    scenario, q, nominal, qdot = problem(name, stages)
    data, x, system, g = with_tasks(scenario, q, nominal, qdot)
    plain = np.empty_like(qdot)
    value = analytic_gradient(data, q, nominal, qdot, plain)
    assert analytic_task_gradient(data, nominal, x, system.jacobian, g) == pytest.approx(value, rel=1e-9)
    by_q = np.einsum("iaj,ia->ij", system.jacobian, g.errors)
    along = g.qdot + scenario.dt * np.cumsum(by_q[::-1], axis=0)[::-1]
    np.testing.assert_allclose(along, plain, atol=1e-9 * max(abs(plain).max(), 1.0))

    other, jacobian = Unknowns(*map(np.empty_like, x)), np.empty_like(system.jacobian)
    before = [part.copy() for part in x]
    assert difference_task_gradient(data, nominal, x, 1e-4, jacobian, other) == pytest.approx(value, rel=1e-9)
    for part, copy in zip(x, before, strict=True):
        np.testing.assert_array_equal(part, copy)
    step = 1e-4 * scenario.dt
    np.testing.assert_allclose(jacobian, system.jacobian, atol=1e-6 + 100 * step)
    for name in ("errors", "qdot"):
        exact = getattr(g, name)
        np.testing.assert_allclose(getattr(other, name), exact, atol=3e-3 * max(abs(exact).max(), 1.0))


@pytest.mark.parametrize("stages", [1, 20])
@pytest.mark.parametrize("name", ["varga7-fast", "zhang3-helix"])
def test_reduced_gradient_with_task_coordinates(name, stages):
    """Against eq. 4 with multipliers by least squares, and against the plain gradient preconditioned."""
    scenario, q, nominal, qdot = problem(name, stages)
    data, x, system, g = with_tasks(scenario, q, nominal, qdot)
    analytic_task_gradient(data, nominal, x, system.jacobian, g)
    (_, e, n), dt = system.jacobian.shape, scenario.dt
    full = np.concatenate([g.errors.ravel(), np.zeros(stages * n), g.qdot.ravel()])
    blocks = np.zeros((stages * e, stages * n))
    for i in range(stages):
        blocks[i * e : (i + 1) * e, i * n : (i + 1) * n] = system.jacobian[i]
    kinematics = np.hstack([np.eye(stages * e), -blocks, np.zeros((stages * e, stages * n))])
    a = np.vstack([kinematics, np.hstack([np.zeros((stages * n, stages * e)), dt * constraints(dt, stages, n)])])
    wanted, _ = reduced_by_hand(a, full)

    plain = np.empty_like(qdot)
    analytic_gradient(data, q, nominal, qdot, plain)
    for _ in range(2):  # the system is used again at each step
        analytic_task_gradient(data, nominal, x, system.jacobian, g)
        assert reduce_task_gradient(dt, system, g)
        reduced = np.concatenate([part.ravel() for part in g])
        scale = np.linalg.norm(full)
        np.testing.assert_allclose(reduced, wanted, atol=1e-9 * scale)
        # The constraints stagnate along it.
        np.testing.assert_allclose(a @ reduced, 0.0, atol=1e-9 * scale)

    by_qdot = blocks @ np.kron(dt * np.tril(np.ones((stages, stages))), np.eye(n))
    lower = np.kron(np.tril(np.ones((stages, stages))), np.eye(n))
    m = np.eye(stages * n) + dt**2 * lower.T @ lower + by_qdot.T @ by_qdot
    preconditioned = np.linalg.solve(m, plain.ravel())
    np.testing.assert_allclose(g.qdot.ravel(), preconditioned, atol=1e-8 * scale)
    assert reduced @ reduced == pytest.approx(plain.ravel() @ preconditioned, rel=1e-6)


def test_no_reduced_gradient_of_numbers_that_are_not_finite():
    scenario, q, nominal, qdot = problem("varga7-fast", 2)
    data, x, system, g = with_tasks(scenario, q, nominal, qdot)
    x.q[0, 0] = np.nan
    for difference in (0.0, 1e-3):
        assert reduced_task_gradient(data, nominal, difference, x, system, g) == np.inf
