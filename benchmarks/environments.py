"""Steps of environments: one through `gym.make`, and many at once."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

import ikgym  # noqa: F401  # registers the environment
from benchmarks.measuring import FULL, Effort, medians
from benchmarks.table import Table

OURS = "RedundantIK-v0"
SCENARIOS = ("varga7-fast", "varga7-random")
#: Gymnasium steps its environments one by one: more of them would only take longer.
MOST_IN_A_ROW = 1024


def tables(effort: Effort = FULL) -> list[Table]:
    """Steps of one environment, and of N."""
    return [_single(effort), *(_vector(rows, effort) for rows in effort.rows)]


def _single(effort: Effort) -> Table:
    calls = {f"{OURS}, {scenario}": _step(gym.make(OURS, scenario=scenario)) for scenario in SCENARIOS}
    calls |= {name: _step(gym.make(name)) for name in ("Pendulum-v1", "Reacher-v5")}
    times = medians(calls, effort.rounds, effort.seconds)
    return Table(
        "One step of one environment",
        "Through `gym.make` with its usual wrappers, a fixed action, the resets of ended episodes included; medians.",
        ("step [µs]", "× varga7-fast"),
        {name: (1e6 * t, t / next(iter(times.values()))) for name, t in times.items()},
    )


def _step(env: gym.Env[Any, Any]) -> Callable[[], None]:
    """One step with a fixed action; ended episodes are reset."""
    env.reset(seed=0)
    env.action_space.seed(0)
    action = env.action_space.sample() * 0.01

    def step() -> None:
        *_, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()

    return step


def _vector(rows: int, effort: Effort) -> Table:
    skipped, few = [], rows <= MOST_IN_A_ROW
    made = {f"{OURS} native, {scenario}": gym.make_vec(OURS, rows, scenario=scenario) for scenario in SCENARIOS}
    if few:
        made["Pendulum-v1, Gymnasium's SyncVectorEnv"] = gym.make_vec("Pendulum-v1", rows, vectorization_mode="sync")
    else:
        skipped.append(f"SyncVectorEnv with more than {MOST_IN_A_ROW} environments")
    calls: dict[str, Callable[[], object]] = {name: _steps(envs) for name, envs in made.items()}
    try:
        import envpool

        # The 16,384 simulations of MuJoCo take ten seconds to make.
        for name in ("Pendulum-v1", "Reacher-v5") if few else ("Pendulum-v1",):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # its boxes are float64, and Gymnasium minds
                calls[f"{name}, EnvPool"] = _steps(envpool.make_gymnasium(name, num_envs=rows, seed=0), rows)
    except ImportError as e:
        skipped.append(f"EnvPool: {e}")
    times = medians(calls, effort.rounds, effort.seconds)
    return Table(
        f"Steps of {rows:,} environments at once",
        "Actions of 0, as many threads as the environment chooses, medians. Ended episodes are reset: after "
        "3000 steps of RedundantIK-v0, 200 of Pendulum-v1, 50 of Reacher-v5.",
        ("steps per second [10⁶/s]", "time × native, varga7-fast"),
        {name: (1e-6 * rows / t, t / next(iter(times.values()))) for name, t in times.items()},
        tuple(skipped),
    )


def _steps(envs: Any, rows: int | None = None) -> Callable[[], object]:
    """A step with actions of 0, after a reset; ``rows`` where the action space is that of one row."""
    envs.reset() if rows else envs.reset(seed=0)
    actions = np.zeros((*((rows,) if rows else ()), *envs.action_space.shape), dtype=envs.action_space.dtype)
    return lambda: envs.step(actions)
