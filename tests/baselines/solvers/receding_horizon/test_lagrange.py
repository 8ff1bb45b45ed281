"""The traditional way against eq. 3-4 in plain NumPy, and against the plain method."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.evaluation.rollout import rollout
from baselines.solvers.receding_horizon import horizon as horizon_module
from baselines.solvers.receding_horizon.horizon import (
    analytic_gradient,
    analytic_state_gradient,
    difference_gradient,
    difference_state_gradient,
)
from baselines.solvers.receding_horizon.lagrange import factorise, reduce_gradient
from baselines.status import Status
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.solvers.receding_horizon.data import data_of


def constraints(dt, stages, n):
    """A: c(i) = (q(i+1) - q(i))/Δt - q̇(i) by (q(2 … HL), q̇(1 … HL-1)); q(1) is no variable."""
    rise = (np.eye(stages) - np.eye(stages, k=-1)) / dt
    return np.kron(np.hstack([rise, -np.eye(stages)]), np.eye(n))


def problem(name, stages):
    """A horizon off the nominal path, and its kernels' arguments."""
    scenario = ikgym.scenarios.get(name)
    rng = np.random.default_rng(stages)
    q = rng.uniform(-1, 1, scenario.joints)
    path = q + rng.uniform(-5e-3, 5e-3, (stages, scenario.joints))
    nominal = scenario.task.coordinates(*scenario.model.forward(path))
    return scenario, q, nominal, rng.uniform(-2, 2, (stages, scenario.joints))


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
@pytest.mark.parametrize("stages", [1, 2, 5])
@pytest.mark.parametrize("name", ikgym.scenarios.names())
def test_states_eliminated_is_the_plain_gradient(name, stages, kind):
    """dΦ/dq̇(i) = ∂Φ/∂q̇(i) + Δt Σ_{k>i} ∂Φ/∂q(k), for differences as well."""
    scenario, q, nominal, qdot = problem(name, stages)
    by_q, by_qdot, plain = gradients(kind, scenario, q, nominal, qdot)
    eliminated = by_qdot + scenario.dt * np.cumsum(by_q[::-1], axis=0)[::-1]
    np.testing.assert_allclose(eliminated, plain, atol=1e-6 * max(abs(plain).max(), 1.0))


@KINDS
@pytest.mark.parametrize("stages", [1, 2, 5, 20])
@pytest.mark.parametrize("name", ["varga7-fast", "khan8-q1", "zhang3-helix", "zhang6-lspb"])
def test_reduced_gradient(name, stages, kind):
    """Against eq. 4 with multipliers by least squares, and against the plain gradient preconditioned."""
    scenario, q, nominal, qdot = problem(name, stages)
    by_q, by_qdot, plain = gradients(kind, scenario, q, nominal, qdot)
    full = np.concatenate([by_q.ravel(), by_qdot.ravel()])
    a = constraints(scenario.dt, stages, scenario.joints)
    multipliers = np.linalg.lstsq(a.T, -full, rcond=None)[0]
    wanted = full + a.T @ multipliers

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
    plain, reduced = (run(name, 600, gradient=kind) for name in ("rhc_gradient", "rhc_lagrange"))
    np.testing.assert_array_equal(plain.iterations, reduced.iterations)
    np.testing.assert_array_equal(plain.status, reduced.status)
    np.testing.assert_allclose(plain.qdot, reduced.qdot, atol=2e-5)
    assert not np.array_equal(plain.qdot, reduced.qdot)


def test_one_step_differs_from_the_plain_one_by_what_the_metric_says():
    """One α from rest, so that rounding and the rule for α have no say: the difference is (M⁻¹ − I) of the step."""
    observation, _ = gym.make("RedundantIK-v0", preview=4).reset(options={"q": np.full(7, 0.3)})
    common = {"horizon": 5, "iterations": 1, "tolerance": 0.0, "gradient": "analytic"}
    scenario = ikgym.scenarios.get("varga7-fast")
    plans = []
    for name in ("rhc_gradient", "rhc_lagrange"):
        _, state = baselines.make(name, scenario, **common).predict(observation)
        plans.append(state[2][0])
    lower = np.tril(np.ones((4, 4)))
    m = np.eye(4) + scenario.dt**2 * lower.T @ lower
    np.testing.assert_allclose(plans[1], np.linalg.solve(m, plans[0]), rtol=1e-9, atol=1e-12 * abs(plans[0]).max())
    difference = np.linalg.norm(plans[1] - plans[0]) / np.linalg.norm(plans[0])
    assert 1e-7 < difference < scenario.dt**2 * 5**2


def test_diverges_as_printed_and_says_so():
    episode = run("rhc_lagrange", 1500, alpha_max=5e-4)
    assert Status.DIVERGED in episode.status
    assert np.isfinite(episode.qdot).all()


@KINDS
def test_a_blow_up_is_not_taken_for_convergence(kind):
    policy = baselines.make("rhc_lagrange", "varga7-fast", alpha_min=1.0, alpha_max=1.0, iterations=3, gradient=kind)
    env = gym.make("RedundantIK-v0")
    env.reset()
    observation = env.step(np.full(7, 0.01, dtype=np.float32))[0]
    action, state = policy.predict(observation)
    assert policy.report(state).status[0] == Status.DIVERGED
    np.testing.assert_array_equal(action, 0.0)
    np.testing.assert_array_equal(state[2], 0.0)


def test_statuses():
    observation, _ = gym.make("RedundantIK-v0").reset()
    for parameters, wanted in [
        ({"tolerance": 1e12}, Status.CONVERGED),
        ({"tolerance": 0.0, "iterations": 5}, Status.ITERATION_LIMIT),
    ]:
        policy = baselines.make("rhc_lagrange", "varga7-fast", **parameters)
        _, state = policy.predict(observation)
        assert policy.report(state).status[0] == wanted


@pytest.mark.parametrize(("kind", "horizon"), [("finite_difference", 3), ("finite_difference", 6), ("analytic", 4)])
def test_operations_are_what_is_called(kind, horizon, monkeypatch):
    policy = baselines.make("rhc_lagrange", "varga7-fast", gradient=kind, horizon=horizon)
    calls = {"forward": 0, "forward_and_jacobian": 0}
    for name in calls:
        kernel = getattr(horizon_module, name)

        def counted(*args, name=name, kernel=kernel):
            calls[name] += 1
            return kernel(*args)

        monkeypatch.setattr(horizon_module, name, counted)
    scenario, _, nominal, qdot = problem("varga7-fast", horizon - 1)
    data, out = data_of(scenario), np.empty((2, *qdot.shape))
    if kind == "analytic":
        analytic_state_gradient.py_func(data, nominal, qdot.copy(), qdot, out[0], out[1])
    else:
        difference_state_gradient.py_func(data, nominal, qdot.copy(), qdot, 1e-3, out[0], out[1])
    forwards, jacobians, factorisations, measurements = policy.count(np.array([0]))
    assert np.all(forwards == calls["forward"])
    assert np.all(jacobians == calls["forward_and_jacobian"])
    assert (factorisations, measurements) == (1, 0)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"horizon": 1}, InvalidInputError, "horizon: expected a whole number of at least 2, got 1"),
        ({"alpha_max": 1e-9}, InvalidInputError, "alpha_max: expected at least alpha_min"),
        ({"gradient": "analytc"}, UnknownNameError, "Did you mean 'analytic'"),
    ],
)
def test_bad_parameters(change, error, message):
    with pytest.raises(error, match=message):
        baselines.make("rhc_lagrange", "varga7-fast", **change)
