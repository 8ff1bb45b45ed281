"""Steps of environments of Stable-Baselines3, alone and with a policy that collects them for PPO."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks.effort import FULL, Effort
from benchmarks.table import Column, Table
from benchmarks.timing import medians
from ikgym.exceptions import MissingDependencyError

OURS = "RedundantIKVecEnv"
SCENARIO = "varga7-random"
#: Single environments are stepped one by one: more of them would only take longer.
MOST_IN_A_ROW = 1024
#: Steps of each row in a turn of PPO.
STEPS = 8


def tables(effort: Effort = FULL) -> list[Table]:
    """Steps of N environments of Stable-Baselines3, for all N that it could be asked for."""
    with _one_thread():
        return [_table(rows, effort) for rows in effort.rows if rows <= MOST_IN_A_ROW]


def environments(rows: int) -> dict[str, Any]:
    """Environments of Stable-Baselines3 that return the same, by name.

    Raises:
        MissingDependencyError: Stable-Baselines3 is not installed.
    """
    from ikgym.sb3 import RedundantIKVecEnv  # first, as it says how to install what is missing

    # isort: split
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv

    def single() -> Any:
        return Monitor(gym.make("RedundantIK-v0", scenario=SCENARIO))

    return {OURS: RedundantIKVecEnv(rows, SCENARIO), "DummyVecEnv": DummyVecEnv([single] * rows)}


def stepping(env: Any) -> Callable[[], object]:
    """A step of all rows, with actions of 0."""
    env.seed(0)
    env.reset()
    actions = np.zeros((env.num_envs, *env.action_space.shape), dtype=np.float32)
    return lambda: env.step(actions)


def collecting(env: Any) -> Callable[[], object]:
    """`STEPS` steps of all rows by the small default policy of PPO, into its buffer."""
    from stable_baselines3 import PPO

    agent = PPO("MultiInputPolicy", env, n_steps=STEPS, batch_size=STEPS * env.num_envs, seed=0, device="cpu")
    _, callback = agent._setup_learn(total_timesteps=1)
    return lambda: agent.collect_rollouts(env, callback, agent.rollout_buffer, STEPS)


def _table(rows: int, effort: Effort) -> Table:
    skipped: tuple[str, ...] = ()
    figures: dict[str, tuple[float | None, ...]] = {}
    try:
        steps = {name: stepping(env) for name, env in environments(rows).items()}
        collections = {name: collecting(env) for name, env in environments(rows).items()}
    except MissingDependencyError as e:
        skipped = (str(e),)
    else:
        alone, collected = medians(steps, effort.rounds, effort.seconds), medians(collections, effort.rounds, 0.0)
        for name in steps:
            figures[name] = (
                1e-3 * rows / alone[name],
                alone[name] / alone[OURS],
                1e-3 * rows * STEPS / collected[name],
                collected[name] / collected[OURS],
            )
    return Table(
        f"collection_{rows}",
        f"Stable-Baselines3: steps of {rows:,} environments, alone and collected for PPO",
        f"Scenario {SCENARIO}. Alone with actions of 0; collected by the default `MultiInputPolicy` of PPO (two "
        "hidden layers of 64) on one thread of PyTorch. Medians.",
        (
            Column("steps_per_ms", "steps per second", "10³/s"),
            Column("step_ratio", f"time × {OURS}"),
            Column("collected_per_ms", "collected per second", "10³/s"),
            Column("collect_ratio", f"time × {OURS}, collected"),
        ),
        figures,
        skipped,
    )


@contextmanager
def _one_thread() -> Iterator[None]:
    """Threads of PyTorch spend their time waiting for each other where networks are this small."""
    try:
        import torch
    except ImportError:
        yield
        return
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
