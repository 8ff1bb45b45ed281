"""Times of `predict` along an episode, one arm at a time."""

from __future__ import annotations

import time

import gymnasium as gym
import numpy as np

import baselines
from baselines.solvers.rivals.base import Rival
from benchmarks.measuring import FULL, Effort
from benchmarks.table import Table

#: Policies by scenario. In the second one the Panda has a hand, and ten boxes around it.
POLICIES = {"panda-circle": ("dls", "qp", "sns", "pink", "mink"), "panda-clutter-random": ("dls", "null_space", "qp")}


def tables(effort: Effort = FULL) -> list[Table]:
    """Times of `predict`."""
    return [
        Table(
            f"One predict in {scenario}",
            f"One arm, the first {effort.steps} steps of an episode, one policy after the other; × env.step: the "
            "median over that of a step of the environment through `gym.make`, in turn with the calls; library: the "
            "median of the calls of another project's library alone, in turn with `predict`, which contains them.",
            ("median [µs]", "99th percentile [µs]", "× env.step", "library [µs]"),
            {name: _episode(scenario, name, effort.steps) for name in names},
        )
        for scenario, names in POLICIES.items()
    ]


def _episode(scenario: str, name: str, steps: int) -> tuple[float, float, float, float | None]:
    """Median and 99th percentile of the time of a call, the median over that of a step, and a library's own."""
    policy = baselines.make(name, scenario)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=policy.preview)
    usual = gym.make("RedundantIK-v0", scenario=scenario)  # its step takes no longer if a policy looks far ahead
    observation, _ = env.reset(seed=0)
    usual.reset(seed=0)
    policy.predict(observation)
    rival = policy if isinstance(policy, Rival) else None
    library = rival and rival.make_step()
    state, start, times = None, observation["q"].copy(), np.zeros((3, steps))
    for k in range(steps):
        begin = time.perf_counter()
        action, state = policy.predict(observation, state)
        between = time.perf_counter()
        usual.step(action)
        times[:2, k] = between - begin, time.perf_counter() - between
        if rival and library:
            q, qdot, pose, nominal = (observation[key] for key in ("q", "qdot", "pose", "nominal"))
            seen = rival.seen(q, qdot, start, pose, nominal[0])
            begin = time.perf_counter()
            library(seen)
            times[2, k] = time.perf_counter() - begin
        observation, *_ = env.step(action)
    predicting, stepping, alone = map(float, 1e6 * np.median(times, axis=1))
    return predicting, 1e6 * float(np.quantile(times[0], 0.99)), predicting / stepping, alone or None
