"""Times of `predict` along an episode, one arm at a time."""

from __future__ import annotations

import time

import gymnasium as gym
import numpy as np

import baselines
import ikgym
from baselines.evaluation.compare.library_times import library_times
from baselines.solvers.rivals.base import Rival
from benchmarks.measuring import FULL, Effort
from benchmarks.table import Table

SCENARIO, POLICIES = "panda-circle", ("dls", "qp", "sns", "pink", "mink")


def tables(effort: Effort = FULL) -> list[Table]:
    """Times of `predict`."""
    note = (
        f"One arm, the first {effort.steps} steps of an episode, one policy after the other; library: the median of "
        "the calls of another project's library alone on the same steps, which `predict` contains."
    )
    columns = ("median [µs]", "99th percentile [µs]", "library [µs]")
    return [
        Table(f"One predict in {SCENARIO}", note, columns, {name: _episode(name, effort.steps) for name in POLICIES})
    ]


def _episode(name: str, steps: int) -> tuple[float, float, float | None]:
    """Median and 99th percentile of the time of a call, and the median of a library's own."""
    policy = baselines.make(name, SCENARIO)
    env = gym.make("RedundantIK-v0", scenario=SCENARIO, preview=policy.preview)
    observation, _ = env.reset(seed=0)
    policy.predict(observation)
    state, times = None, np.zeros(steps)
    for k in range(steps):
        begin = time.perf_counter()
        action, state = policy.predict(observation, state)
        times[k] = time.perf_counter() - begin
        observation, *_ = env.step(action)
    predicting, slow = map(float, 1e6 * np.quantile(times, (0.5, 0.99)))
    if not isinstance(policy, Rival):
        return predicting, slow, None
    return predicting, slow, 1e6 * float(np.median(library_times(policy, ikgym.scenarios.get(SCENARIO), steps)))
