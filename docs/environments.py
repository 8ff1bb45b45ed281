"""The table `environments`: steps of one environment through `gym.make`, and of many at once.

Actions are 0, and ended episodes are reset. EnvPool is left out where it is not installed (``make rivals``).
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np

import ikgym  # noqa: F401  # registers the environment
from docs.keeping import Line
from docs.timing import medians

SCENARIOS = ("varga7-fast", "varga7-random")
#: Largest vector of Gymnasium's environments, which are stepped one by one, and of EnvPool's simulations of MuJoCo.
MOST = 1024


def measure(sizes: Sequence[int] = (64, 1024, 16384), **effort: Any) -> list[Line]:
    """The table, one line an environment and number of arms; 1 means `gym.make`."""
    calls = {(f"RedundantIK-v0, {name}", 1): _single("RedundantIK-v0", scenario=name) for name in SCENARIOS}
    calls |= {(name, 1): _single(name) for name in ("Pendulum-v1", "Reacher-v5")}
    for n in sizes:
        for name in SCENARIOS:
            calls[f"RedundantIK-v0, {name}", n] = _steps(gym.make_vec("RedundantIK-v0", n, scenario=name))
        if n <= MOST:
            envs = gym.make_vec("Pendulum-v1", n, vectorization_mode="sync")
            calls["Pendulum-v1, SyncVectorEnv", n] = _steps(envs)
        with contextlib.suppress(ImportError), warnings.catch_warnings():
            import envpool

            warnings.simplefilter("ignore")  # its boxes are float64, and Gymnasium minds
            for name in ("Pendulum-v1", "Reacher-v5") if n <= MOST else ("Pendulum-v1",):
                calls[f"{name}, EnvPool", n] = _steps(envpool.make_gymnasium(name, num_envs=n, seed=0), n)
    times = medians(calls, **effort)
    return [
        {"environment": name, "arms": n, "million_steps_per_s": 1e-6 * n / time} for (name, n), time in times.items()
    ]


def _single(name: str, **options: Any) -> Callable[[], object]:
    env = gym.make(name, **options)
    env.reset(seed=0)
    action: Any = np.zeros(env.action_space.shape or (), dtype=env.action_space.dtype)

    def step() -> None:
        *_, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()

    return step


def _steps(envs: Any, rows: int | None = None) -> Callable[[], object]:
    """A step with actions of 0, after a reset; ``rows`` where the action space is that of one row."""
    envs.reset() if rows else envs.reset(seed=0)
    actions = np.zeros((*((rows,) if rows else ()), *envs.action_space.shape), dtype=envs.action_space.dtype)
    return lambda: envs.step(actions)
