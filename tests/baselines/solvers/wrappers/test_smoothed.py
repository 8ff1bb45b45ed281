"""Second-order smoothing: the filter, what the inner policy sees, and what is refused."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.status import Status

STEPS = 100


def short(name="varga7-fast", steps=STEPS, **changes):
    return ikgym.scenarios.get(name).replace(steps=steps, **changes)


def smoothed(scenario, **parameters):
    return baselines.make("smoothed", scenario, **parameters)


def printed(path, dt, lambda_):
    """Eq. 16 (with its dot) and 17 over a whole calculated path, afterwards."""
    q, qdot, out = path[0].copy(), np.zeros_like(path[0]), []
    for g in path:
        out.append(qdot)
        bend = lambda_**2 * (g - q) - 2 * lambda_ * qdot
        q, qdot = q + dt * qdot, qdot + dt * bend
    return np.array(out)


@pytest.mark.parametrize(("policy", "lambda_"), [("rhc_gradient", 300.0), ("dls", 30.0), ("mfac", 1500.0)])
def test_is_the_papers_filter_on_the_path_of_the_policy_alone(policy, lambda_):
    """The inner policy runs as if alone, and what the arm is sent is the smoothed path, as computed afterwards."""
    scenario = short()
    alone = rollout(scenario, baselines.make(policy, scenario), 0)
    episode = rollout(scenario, smoothed(scenario, policy=policy, relaxation=lambda_), 0)
    np.testing.assert_array_equal(episode.iterations, alone.iterations)
    path = np.vstack([scenario.nominal_joint_path()[0], alone.q])[:STEPS]
    wanted = printed(path, scenario.dt, lambda_)
    # The arm is sent float32 fractions of 20 rad/s.
    np.testing.assert_allclose(episode.qdot, wanted, atol=2e-5 * max(1.0, lambda_ / 300))


def test_a_saturated_velocity_is_remembered_as_it_was_sent():
    """Otherwise the filter would take the arm for faster than it is; and it starts from the q that is measured."""
    scenario = short(velocity_limit=np.full(7, 2.0), plant=ikgym.Plant(bias=0.1))
    policy = smoothed(scenario, policy="moore_penrose", relaxation=1500.0)
    assert Status.SATURATED in rollout(scenario, policy, 0).status
    path = [scenario.nominal_joint_path()[0]]
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=1)
    observation, _ = env.reset()
    state, sent = None, np.zeros(7)
    for _ in range(100):
        action, state = policy.predict(observation, state)
        bend = 1500.0**2 * (path[-1] - observation["q"]) - 2 * 1500.0 * sent
        np.testing.assert_allclose(action * 2.0, np.clip(sent, -2, 2), atol=1e-6)
        sent = np.clip(sent + scenario.dt * bend, -2.0, 2.0)
        path.append(policy.split(policy.memory_of(state))[0].q[0])
        observation, *_ = env.step(action)
