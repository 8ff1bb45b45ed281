"""Bounds of a scenario: what would overflow, or fill the memory, is refused in one clear line."""

import math

import gymnasium as gym
import numpy as np
import pytest

import ikgym
from ikgym import scenarios, validation
from ikgym.exceptions import InvalidInputError
from ikgym.trajectories import Sinusoid
from tests.every_scenario import every_scenario

FAST = scenarios.get("varga7-fast")


@pytest.mark.parametrize(
    "change",
    [
        {"cost": ikgym.TrackingCost(p_x=100)},
        {"cost": ikgym.TrackingCost(p_out=100), "velocity_limit": 100.0},
        {"cost": ikgym.TrackingCost(delta_x=1e-12, p_x=20)},
        {"cost": ikgym.TrackingCost(p_out=50), "velocity_limit": 1e5},
    ],
)
def test_a_worst_episode_that_costs_too_much_is_refused(change):
    with pytest.raises(InvalidInputError, match=r"expected a cost of at most 1e\+150 for the worst episode, got"):
        FAST.replace(**change)


@pytest.mark.parametrize("name", every_scenario())
def test_bounds_are_true_at_the_worst(name):
    """From the farthest start, at full speed; that of the cost is within 12 decades of what happens."""
    changes = {"steps": 30, "iterations_per_point": 1, "dt": 0.3, "plant": ikgym.Plant(bias=0.5, noise=0.5)}
    scenario = scenarios.get(name).replace(**changes, obstacles=(), collisions=False)
    bound, env, worst = scenario.largest_step_cost(), ikgym.RedundantIKEnv(scenario), 0.0
    for sign in (-1.0, 1.0):
        start = np.clip(sign * scenario.start_bound(), scenario.arm.lower, scenario.arm.upper)
        assert env.observation_space.contains(env.reset(seed=0, options={"q": start})[0])
        for _ in range(scenario.steps):
            observation, reward, *_ = env.step(np.full(scenario.joints, 2.0 * sign))
            assert env.observation_space.contains(observation)
            worst = max(worst, -reward)
    assert 0.0 < worst <= bound < 1e12 * worst


def test_at_the_bounds_all_is_finite():
    scenario = FAST.replace(
        cost=ikgym.TrackingCost(delta_x=1e-12), dt=1e12, velocity_limit=1e12, trajectory=Sinusoid([1e12] * 7, 1e12)
    )
    env = ikgym.RedundantIKEnv(scenario.replace(steps=3))
    env.reset(seed=0)
    for _ in range(3):
        observation, reward, *_ = env.step(np.ones(7))
        assert math.isfinite(reward)
        assert env.observation_space.contains(observation)


@pytest.mark.parametrize("steps", [10**9, 10**400])
@pytest.mark.parametrize("field", ["steps", "iterations_per_point"])
def test_more_steps_than_any_memory_holds(field, steps):
    message = (
        rf"{field}: expected a whole number of at most 100000000, got \d+; .* would take about [\d,.]+ GiB of memory"
    )
    with pytest.raises(InvalidInputError, match=message):
        FAST.replace(**{field: steps})


@pytest.fixture
def little(monkeypatch):
    """A machine with 1 GiB."""
    monkeypatch.setattr(validation, "available_memory", lambda: validation.GIB)


NO_MEMORY = r"expected to fit into memory, but take about [\d,.]+ GiB, and 1\.0 GiB are available"


@pytest.mark.usefixtures("little")
def test_many_steps_need_memory():
    with pytest.raises(InvalidInputError, match=f"The 50000001 nominal points of an episode: {NO_MEMORY}"):
        FAST.replace(steps=50_000_000)


@pytest.mark.parametrize("make", [
    lambda n: gym.make_vec("RedundantIK-v0", num_envs=n, scenario="varga7-random"),
    lambda n: ikgym.RedundantIKVectorEnv(n),
    lambda n: __import__("ikgym.sb3").sb3.RedundantIKVecEnv(n, "varga7-random"),
])  # fmt: skip
@pytest.mark.parametrize("number", [10**6, 10**400])
@pytest.mark.usefixtures("little")
def test_many_environments_need_memory(make, number):
    with pytest.raises(
        InvalidInputError, match=f"{number} environments: expected to fit" if number < 10**400 else "to fit"
    ):
        make(number)


def test_what_is_available_is_what_system_and_group_leave(tmp_path, monkeypatch):
    system, most, taken = (tmp_path / name for name in ("meminfo", "max", "current"))
    monkeypatch.setattr(validation, "SYSTEM", system)
    monkeypatch.setattr(validation, "GROUP", (most, taken))
    system.write_text("MemTotal: 9000 kB\nMemAvailable:    4000 kB\n")
    assert validation.available_memory() == 4000 * 1024
    most.write_text("3000000\n")
    taken.write_text("1000000\n")
    assert validation.available_memory() == 2_000_000
    most.write_text("max\n")
    assert validation.available_memory() == 4000 * 1024
    system.unlink()
    assert validation.available_memory() is None or validation.available_memory() > 0


def test_rewards_that_stable_baselines3_cannot_hold():
    sb3 = pytest.importorskip("ikgym.sb3")
    steep = FAST.replace(cost=ikgym.TrackingCost(p_x=15))
    assert steep.largest_step_cost() > 1e39
    with pytest.raises(InvalidInputError, match=r"expected steps that cost at most 3\.4e\+38, since rewards of"):
        sb3.RedundantIKVecEnv(2, steep)
