"""Varga's method against the paper written down once more in plain NumPy, and its statuses."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines import episodes
from baselines.solvers.receding_horizon.horizon import analytic_gradient, difference_gradient
from baselines.status import Status
from tests.baselines.solvers.receding_horizon.data import data_of, horizon_cost, joint_weights
from tests.every_scenario import ONE_OF_EACH


def phi(scenario, q, nominal, qdot, weights=1.0):
    """Φ of the paper, section III, by the public parts of ikgym, with weights of the joints."""
    total = 0.0
    for velocity, target in zip(qdot, nominal, strict=True):
        q = q + scenario.dt * velocity
        error = scenario.task.error(target, scenario.task.coordinates(*scenario.model.forward(q)))
        total += scenario.cost.tracking(error) + np.sum(weights * scenario.cost.velocity(velocity[:, None]))
    return total


def printed(scenario, q, nominal, qdot, alpha, alpha_max, steps):
    """The descent of section IV."""
    qdot, last, made = qdot.copy(), None, 0
    while True:
        here = phi(scenario, q, nominal, qdot)
        gradient = np.empty_like(qdot)
        for index in np.ndindex(qdot.shape):
            shifted = qdot.copy()
            shifted[index] += 1e-3
            gradient[index] = (phi(scenario, q, nominal, shifted) - here) / 1e-3
        norm = np.linalg.norm(gradient)
        if norm <= 20 or made == steps:
            return qdot, alpha, made
        if last is not None:
            alpha = alpha * 1.2 if norm < last else alpha / 1.2 if norm > last else alpha
            alpha = min(max(alpha, 1e-8), alpha_max)
        last, made = norm, made + 1
        qdot = qdot - alpha * gradient


@pytest.mark.parametrize(("alpha_start", "warm_start"), [("restart", "unshifted"), ("kept", "shifted")])
@pytest.mark.parametrize("name", ["varga7-literal-slow", "zhang6-lspb"])
def test_follows_the_printed_descent(name, warm_start, alpha_start):
    scenario = ikgym.scenarios.get(name).replace(steps=12)
    policy = baselines.make("rhc_gradient", scenario, iterations=8, warm_start=warm_start, alpha_start=alpha_start)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=2)
    observation, _ = env.reset()
    state, plan, alpha = None, np.zeros((2, scenario.joints)), 1e-8
    for _ in range(12):
        if alpha_start == "restart":
            alpha = 1e-8
        if warm_start == "shifted":
            plan = plan[[1, 1]]
        plan, alpha, made = printed(scenario, observation["q"], observation["nominal"], plan, alpha, 5e-4, 8)
        action, state = policy.predict(observation, state)
        np.testing.assert_allclose(action * scenario.velocity_limit, plan[0], rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(state[2][0], plan, rtol=1e-6, atol=1e-9)
        assert state[3][0] == pytest.approx(alpha, rel=1e-12)
        assert policy.report(state).iterations[0] == made
        observation, *_ = env.step(action)


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_gradients_against_central_differences(name):
    scenario = ikgym.scenarios.get(name)
    model, rng = scenario.model, np.random.default_rng(5)
    q = rng.uniform(-1, 1, scenario.joints)
    nominal = scenario.task.coordinates(*model.forward(q + rng.uniform(-5e-3, 5e-3, (5, scenario.joints))))
    qdot = rng.uniform(-2, 2, (5, scenario.joints))
    common = (data_of(scenario), q, nominal)
    analytic, forward = np.empty_like(qdot), np.empty_like(qdot)
    value = analytic_gradient(*common, qdot, analytic)
    assert value == difference_gradient(*common, qdot, 1e-7, forward)
    weights = joint_weights(scenario.joints)
    assert value == pytest.approx(phi(scenario, q, nominal, qdot, weights), rel=1e-9)
    central = np.empty_like(qdot)
    for index in np.ndindex(qdot.shape):
        up, down = qdot.copy(), qdot.copy()
        up[index] += 1e-4
        down[index] -= 1e-4
        central[index] = (horizon_cost(*common, up) - horizon_cost(*common, down)) / 2e-4
    scale = max(abs(central).max(), 1.0)
    np.testing.assert_allclose(analytic, central, atol=1e-5 * scale)
    np.testing.assert_allclose(forward, central, atol=1e-3 * scale)


@pytest.mark.parametrize(
    ("alpha_start", "warm_start", "name", "steps"),
    [
        ("kept", "unshifted", "varga7-fast", 100),
        pytest.param("restart", "shifted", "varga7-fast", 1300, marks=pytest.mark.slow),
        ("restart", "shifted", "varga7-literal-fast", 220),
        pytest.param("restart", "unshifted", "varga7-literal-fast", 2000, marks=pytest.mark.slow),
    ],
)
def test_diverges_as_printed_and_says_so(alpha_start, warm_start, name, steps):
    """After a blow-up the row continues, and nothing claims to have converged."""
    scenario = ikgym.scenarios.get(name).replace(steps=steps)
    policy = baselines.make("rhc_gradient", scenario, alpha_start=alpha_start, warm_start=warm_start)
    assert (policy.alpha_min, policy.alpha_max) == (1e-8, 5e-4)
    episode = episodes.rollout(scenario, policy, 0)
    assert Status.DIVERGED in episode.status
    assert np.isfinite(episode.qdot).all()


@pytest.mark.parametrize(("steps", "cost"), [(300, 7.154e6), pytest.param(3000, 5.604e7, marks=pytest.mark.slow)])
def test_restarted_alpha_does_not_diverge_as_printed(steps, cost):
    scenario = ikgym.scenarios.get("varga7-fast").replace(steps=steps)
    policy = baselines.make("rhc_gradient", scenario)
    assert (policy.alpha_start, policy.warm_start, policy.alpha_max) == ("restart", "unshifted", 5e-4)
    episode = episodes.rollout(scenario, policy, 0)
    assert Status.DIVERGED not in episode.status
    assert episode.position_error.max() < 0.06
    assert (episode.tracking_cost + episode.velocity_cost).sum() == pytest.approx(cost, rel=1e-3)


@pytest.mark.parametrize("gradient", ["finite_difference", "analytic"])
def test_a_blow_up_is_not_taken_for_convergence(gradient):
    """One huge step leads where finite differences of the cost are exactly 0."""
    policy = baselines.make(
        "rhc_gradient", "varga7-fast", alpha_min=1.0, alpha_max=1.0, iterations=3, gradient=gradient
    )
    env = gym.make("RedundantIK-v0")
    env.reset()
    observation = env.step(np.full(7, 0.01, dtype=np.float32))[0]
    action, state = policy.predict(observation)
    assert policy.report(state).status[0] == Status.DIVERGED
    np.testing.assert_array_equal(action, 0.0)
    np.testing.assert_array_equal(state[2], 0.0)
