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

Calls = dict[str, Callable[[], object]]
OURS = "RedundantIK-v0, varga7-fast"
#: Gymnasium steps its environments one by one: more of them would only take longer.
MOST_IN_A_ROW = 1024


def tables(effort: Effort = FULL) -> list[Table]:
    """Steps of one environment, and of N."""
    return [_single_table(effort), *(_vector_table(rows, effort) for rows in effort.rows)]


def stepper(env_id: str, **kwargs: Any) -> Callable[[], None]:
    """One step of a single environment with a fixed action; ended episodes are reset."""
    env = gym.make(env_id, **kwargs)
    env.reset(seed=0)
    env.action_space.seed(0)
    action = env.action_space.sample() * 0.01

    def step() -> None:
        *_, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()

    return step


def single() -> Calls:
    """Steps through `gym.make` by name."""
    calls: Calls = {
        OURS: stepper("RedundantIK-v0", scenario="varga7-fast"),
        "RedundantIK-v0, varga7-random": stepper("RedundantIK-v0", scenario="varga7-random"),
        "Pendulum-v1": stepper("Pendulum-v1"),
        "Reacher-v5": stepper("Reacher-v5"),
    }
    return calls


def vector(rows: int) -> tuple[Calls, tuple[str, ...]]:
    """Steps of vector environments by name, each of all its rows, and what is left out."""
    calls, skipped = {}, []
    for scenario in ("varga7-fast", "varga7-random"):
        calls[f"RedundantIK-v0 native, {scenario}"] = _stepping(
            gym.make_vec("RedundantIK-v0", num_envs=rows, scenario=scenario)
        )
    if rows <= MOST_IN_A_ROW:
        calls["Pendulum-v1, Gymnasium's SyncVectorEnv"] = _stepping(
            gym.make_vec("Pendulum-v1", num_envs=rows, vectorization_mode="sync")
        )
    else:
        skipped.append(f"SyncVectorEnv with more than {MOST_IN_A_ROW} environments")
    try:
        import envpool
    except ImportError as e:
        return calls, (*skipped, f"EnvPool: {e}")
    # The 16,384 simulations of MuJoCo take ten seconds to make.
    for name in ("Pendulum-v1", "Reacher-v5") if rows <= MOST_IN_A_ROW else ("Pendulum-v1",):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # its boxes are float64, and Gymnasium minds
            calls[f"{name}, EnvPool"] = _stepping(envpool.make_gymnasium(name, num_envs=rows, seed=0), rows)
    return calls, tuple(skipped)


def _stepping(envs: Any, rows: int | None = None) -> Callable[[], object]:
    """A step with actions of 0, after a reset; ``rows`` where the action space is that of one row."""
    envs.reset() if rows else envs.reset(seed=0)
    actions = np.zeros((*((rows,) if rows else ()), *envs.action_space.shape), dtype=envs.action_space.dtype)
    return lambda: envs.step(actions)


def _single_table(effort: Effort) -> Table:
    times = medians(single(), effort.rounds, effort.seconds)
    return Table(
        "One step of one environment",
        "Through `gym.make` with its usual wrappers, a fixed action, the resets of ended episodes included; medians.",
        ("step [µs]", "× varga7-fast"),
        {name: (1e6 * t, t / times[OURS]) for name, t in times.items()},
    )


def _vector_table(rows: int, effort: Effort) -> Table:
    calls, skipped = vector(rows)
    times = medians(calls, effort.rounds, effort.seconds)
    reference = next(iter(times.values()))
    return Table(
        f"Steps of {rows:,} environments at once",
        "Actions of 0, as many threads as the environment chooses, medians. Ended episodes are reset: after "
        "3000 steps of RedundantIK-v0, 200 of Pendulum-v1, 50 of Reacher-v5.",
        ("steps per second [10⁶/s]", "time × native, varga7-fast"),
        {name: (1e-6 * rows / t, t / reference) for name, t in times.items()},
        skipped,
    )
