"""Steps of environments: one through `gym.make`, and many at once."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

import ikgym

ROWS = (64, 1024, 16384)


def stepper(env_id: str, **kwargs: Any) -> Callable[[], None]:
    """One step of a single environment with a fixed action; episodes begin anew when they end."""
    env = gym.make(env_id, **kwargs)
    env.reset(seed=0)
    env.action_space.seed(0)
    action = env.action_space.sample() * 0.01

    def step() -> None:
        *_, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()

    return step


def single() -> dict[str, Callable[[], None]]:
    """Steps through `gym.make`, by name."""
    calls = {
        "RedundantIK-v0, varga7-fast": stepper("RedundantIK-v0", scenario="varga7-fast"),
        "RedundantIK-v0, varga7-random": stepper("RedundantIK-v0", scenario="varga7-random"),
        "Pendulum-v1": stepper("Pendulum-v1"),
    }
    try:
        calls["Reacher-v5"] = stepper("Reacher-v5")
    except (ImportError, gym.error.DependencyNotInstalled) as e:
        warnings.warn(f"Reacher-v5 is left out: {e}", stacklevel=2)
    return calls


def whole_episodes(rows: int, scenario: str = "varga7-random") -> float:
    """Steps per second of the native vector environment over a whole episode of each row, the resets included.

    Args:
        rows: How many arms.
        scenario: A scenario's name.
    """
    envs = gym.make_vec("RedundantIK-v0", num_envs=rows, scenario=scenario, autoreset_mode="SameStep")
    envs.reset(seed=0)
    actions = np.zeros(envs.action_space.shape or (), dtype=np.float32)
    envs.step(actions)
    steps = ikgym.scenarios.get(scenario).steps
    begin = time.perf_counter()
    for _ in range(steps):
        envs.step(actions)
    return rows * steps / (time.perf_counter() - begin)


def vector(rows: int) -> dict[str, Callable[[], object]]:
    """Steps of vector environments, by name; each steps all its rows."""
    calls: dict[str, Callable[[], object]] = {}
    for scenario in ("varga7-fast", "varga7-random"):
        envs = gym.make_vec("RedundantIK-v0", num_envs=rows, scenario=scenario)
        envs.reset(seed=0)
        actions = np.zeros(envs.action_space.shape or (), dtype=np.float32)
        calls[f"RedundantIK-v0 native, {scenario}"] = lambda envs=envs, actions=actions: envs.step(actions)  # type: ignore[misc]
    return calls
