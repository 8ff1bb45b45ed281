"""The traditional way against eq. 3-4 in plain NumPy, and against the plain method."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.solvers.receding_horizon.horizon import (
    analytic_gradient,
    analytic_state_gradient,
    difference_gradient,
    difference_state_gradient,
)
from baselines.solvers.receding_horizon.lagrange import factorise, reduce_gradient
from baselines.status import Status
from tests.baselines.solvers.receding_horizon.data import constraints, data_of, problem, reduced_by_hand


def gradients(kind, scenario, q, nominal, qdot):
    """By states and velocities, and along the constraints as the plain method has it."""
    states = q + scenario.dt * np.cumsum(qdot, axis=0)
    by_q, by_qdot, plain = np.empty_like(qdot), np.empty_like(qdot), np.empty_like(qdot)
    data = data_of(scenario)
    if kind == "analytic":
        value = analytic_state_gradient(data, nominal, states, qdot, by_q, by_qdot)
        same = analytic_gradient(data, q, nominal, qdot, plain)
    else:
        value = difference_state_gradient(data, nominal, states, qdot, 1e-3, by_q, by_qdot)
        same = difference_gradient(data, q, nominal, qdot, 1e-3, plain)
    assert value == pytest.approx(same, rel=1e-9)
    return by_q, by_qdot, plain


KINDS = pytest.mark.parametrize("kind", ["analytic", "finite_difference"])


@KINDS
@pytest.mark.parametrize("stages", [1, 20])
@pytest.mark.parametrize("name", ["varga7-fast", "zhang3-helix", "khan8-q1", "zhang6-lspb"])
def test_reduced_gradient(name, stages, kind):
    """Against eq. 4 with multipliers by least squares, and against the plain gradient preconditioned."""
    scenario, q, nominal, qdot = problem(name, stages)
    by_q, by_qdot, plain = gradients(kind, scenario, q, nominal, qdot)
    full = np.concatenate([by_q.ravel(), by_qdot.ravel()])
    a = constraints(scenario.dt, stages, scenario.joints)
    wanted, multipliers = reduced_by_hand(a, full)
    diagonal, ratio, got = np.empty(stages), np.empty(stages), np.empty_like(qdot)
    factorise(scenario.dt, diagonal, ratio)
    reduce_gradient(scenario.dt, diagonal, ratio, got, by_q, by_qdot)
    reduced = np.concatenate([by_q.ravel(), by_qdot.ravel()])
    scale = np.linalg.norm(full)
    np.testing.assert_allclose(got.ravel(), multipliers, atol=1e-9 * abs(multipliers).max())
    np.testing.assert_allclose(reduced, wanted, atol=1e-11 * scale)
    # The constraints stagnate along it.
    np.testing.assert_allclose(scenario.dt * a @ reduced, 0.0, atol=1e-12 * scale)

    lower = np.tril(np.ones((stages, stages)))
    m = np.eye(stages) + scenario.dt**2 * lower.T @ lower
    tolerance = 1e-9 if kind == "analytic" else 1e-6
    preconditioned = np.linalg.solve(m, plain)
    np.testing.assert_allclose(by_qdot, preconditioned, atol=tolerance * max(abs(plain).max(), 1.0))
    assert reduced @ reduced == pytest.approx(np.sum(plain * preconditioned), rel=1e-5)


def run(name, steps, **parameters):
    scenario = ikgym.scenarios.get("varga7-fast").replace(steps=steps)
    return rollout(scenario, baselines.make(name, scenario, **parameters), 0)


@KINDS
def test_follows_the_plain_method_on_the_papers_trajectory(kind):
    """To the order Δt² HL² in each iterate; iterations are the same in number."""
    common = {"gradient": kind, "alpha_start": "kept", "alpha_max": 1e-4}
    plain, reduced = (run(name, 300, **common) for name in ("rhc_gradient", "rhc_lagrange"))
    np.testing.assert_array_equal(plain.iterations, reduced.iterations)
    np.testing.assert_array_equal(plain.status, reduced.status)
    np.testing.assert_allclose(plain.qdot, reduced.qdot, atol=2e-5)
    assert not np.array_equal(plain.qdot, reduced.qdot)


def test_costs_with_task_coordinates_are_those_of_the_plain_method():
    """As printed, with α restarted: the paths separate for a while, the costs do not."""
    plain = run("rhc_gradient", 300, gradient="analytic")
    reduced = run("rhc_lagrange", 300, gradient="analytic", states=True)
    cost, wanted = (float((e.tracking_cost + e.velocity_cost).sum()) for e in (reduced, plain))
    assert cost == pytest.approx(wanted, rel=3e-3)
    assert set(reduced.status) == {Status.CONVERGED}
    assert np.mean(reduced.iterations) == pytest.approx(np.mean(plain.iterations), rel=0.05)
