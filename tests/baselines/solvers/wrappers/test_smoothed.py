"""Second-order smoothing: the filter, what the inner policy sees, and what is refused."""

import dataclasses

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


def calculated(policy, state):
    """The joint coordinates that the inner policy has brought the model to. Shape (n,)."""
    own, _ = policy.split(policy.memory_of(state))
    return own.q[0]


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


def test_a_constant_velocity_is_followed_2_over_lambda_late():
    scenario = short("faitli3-regular", 400)
    ramp = ikgym.trajectories.Sinusoid(np.full(3, 1e4), 1e-4, offset=np.array([0.1, 0.4, 1.0]))
    scenario = scenario.replace(trajectory=ramp)
    episode = rollout(scenario, smoothed(scenario, policy="moore_penrose", relaxation=100.0), 0)
    nominal = scenario.nominal_joint_path()[1:]
    lag = (nominal - episode.q)[-1]
    # One step more than 2/Λ: the velocity sent was known a step ago.
    np.testing.assert_allclose(lag, 2.0 / 100.0 * 1.0, rtol=0.06)


def test_measured_feedback_corrects_what_the_calculated_path_cannot_know():
    scenario, errors = short("faitli3-regular", 800, plant=ikgym.Plant(bias=0.3)), []
    for feedback in ("calculated", "measured"):
        policy = smoothed(scenario, policy="dls", options={"gain": 0.1, "damping": 1e-6}, feedback=feedback)
        errors.append(rollout(scenario, policy, 0).position_error[-300:].max())
    assert errors[1] < 0.5 * errors[0]


def at_rest(steps, off):
    """An arm that is off a reference that stands still."""
    here = np.array([0.1, 0.4, 1.0])
    still = ikgym.trajectories.Sinusoid(np.zeros(3), offset=here)
    return short("faitli3-regular", steps, trajectory=still, start=here + off)


@pytest.mark.parametrize(("gain", "stable"), [(0.3, True), (0.4, False)])
def test_the_bound_for_measured_feedback(gain, stable):
    """(z - 1)(z - 1 + a)² = -a² g with a = 0.3: stable below 0.35."""
    roots = 1.0 + np.roots([1.0, 0.6, 0.09, 0.09 * gain])
    assert (np.abs(roots).max() < 1.0) == stable
    scenario = at_rest(1000, 1e-6)
    policy = smoothed(scenario, policy="moore_penrose", options={"gain": gain}, feedback="measured")
    errors = rollout(scenario, policy, 0).position_error
    assert (errors[-100:].max() < errors[:100].max()) == stable


def test_euler_is_stable_up_to_its_bound():
    scenario = at_rest(400, 1e-4)
    errors = rollout(scenario, smoothed(scenario, policy="moore_penrose", relaxation=1900.0), 0).position_error
    assert errors[:20].max() > 1e-4
    assert errors[-100:].max() < 1e-7


def test_a_saturated_velocity_is_remembered_as_it_was_sent():
    """Otherwise the filter would take the arm for faster than it is, and swing far beyond."""
    scenario = short(velocity_limit=np.full(7, 2.0))
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
        path.append(calculated(policy, state))
        observation, *_ = env.step(action)


def test_a_disturbed_arm_is_smoothed_from_where_it_is():
    """The filter starts from the measured q, so that what drives add does not pile up."""
    scenario = short(steps=1000)
    disturbed = dataclasses.replace(scenario, plant=ikgym.Plant(bias=0.1))
    episodes = [rollout(s, smoothed(s, policy="dls"), 0) for s in (scenario, disturbed)]
    apart = np.abs(episodes[0].q - episodes[1].q)
    # A constant velocity b from outside leaves 2 b / Λ, and not b t.
    np.testing.assert_allclose(apart[-200:], 2 * 0.1 / 300, rtol=0.02)
