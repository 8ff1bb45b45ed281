"""Times of `predict` along an episode, one arm at a time."""

from __future__ import annotations

import time

import gymnasium as gym
import numpy as np

import baselines
from baselines.solvers.rivals.base import Rival
from benchmarks.measuring import FULL, Effort
from benchmarks.table import Table

#: Policies by scenario and label.
POLICIES: dict[str, dict[str, tuple[str, dict[str, object]]]] = {
    "varga7-fast": {
        **{name: (name, {}) for name in ("follow_nominal", "moore_penrose", "dls", "mfac")},
        "rhc, HL = 3": ("rhc", {"horizon": 3}),
        "rhc, HL = 3, one iteration": ("rhc", {"horizon": 3, "iterations": 1}),
        **{name: (name, {}) for name in ("rhc_foresight", "full_orientation", "agent_alone", "rhc_gradient")},
        "rhc_gradient, always 450 iterations": ("rhc_gradient", {"tolerance": 0.0}),
        "rhc_gradient, analytic": ("rhc_gradient", {"gradient": "analytic"}),
    },
    "zhang6-lspb": {
        "mfapc, n = 2, λ = 0": ("mfapc", {"horizon": 2, "rule": "constant", "damping": 0.0}),
        "mfapc, n = 3, λ > 0, always 10 iterations": (
            "mfapc",
            {"horizon": 3, "rule": "constant", "damping": 1e-3, "iterations": 10, "tolerance": 0.0},
        ),
    },
    "panda-circle": {name: (name, {}) for name in ("dls", "qp", "sns", "pink", "mink")},
}


def tables(effort: Effort = FULL) -> list[Table]:
    """Times of `predict`, a table a scenario."""
    return [_table(scenario, effort) for scenario in POLICIES]


def _table(scenario: str, effort: Effort) -> Table:
    times = {label: _episode(scenario, *policy, effort.steps) for label, policy in POLICIES[scenario].items()}
    columns = ("median [µs]", "99th percentile [µs]", "× env.step", "library [µs]")
    # Without the column of libraries where there is none.
    shown = columns if any(figures[-1] for figures in times.values()) else columns[:-1]
    return Table(
        f"One predict in {scenario}",
        f"One arm, the first {effort.steps} steps of an episode, one policy after the other; × env.step: the median "
        "over that of a step of the environment through `gym.make`, in turn with the calls; library: the median of the "
        "calls of another project's library alone, in turn with `predict`, which contains them.",
        shown,
        {
            label: (1e6 * p50, 1e6 * p99, ratio, library and 1e6 * library)[: len(shown)]
            for label, (p50, p99, ratio, library) in times.items()
        },
    )


def _episode(
    scenario: str, name: str, parameters: dict[str, object], steps: int
) -> tuple[float, float, float, float | None]:
    """Median and 99th percentile of the time of a call, in [s], the median over that of a step, and a library's own."""
    policy = baselines.make(name, scenario, **parameters)
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
    predicting, stepping, alone = map(float, np.median(times, axis=1))
    return predicting, float(np.quantile(times[0], 0.99)), predicting / stepping, alone or None
