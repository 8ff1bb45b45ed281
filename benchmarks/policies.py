"""Times of `predict` along an episode, one arm at a time."""

from __future__ import annotations

import time
from collections.abc import Callable

import gymnasium as gym
import numpy as np

import baselines
from baselines.policy import Memory
from benchmarks.effort import FULL, Effort
from benchmarks.table import Column, Table

#: Policies by scenario and label.
POLICIES: dict[str, dict[str, tuple[str, dict[str, object]]]] = {
    "varga7-fast": {
        "follow_nominal": ("follow_nominal", {}),
        "moore_penrose": ("moore_penrose", {}),
        "dls": ("dls", {}),
        "mfac": ("mfac", {}),
        "rhc, HL = 3": ("rhc", {"horizon": 3}),
        "rhc, HL = 3, one iteration": ("rhc", {"horizon": 3, "iterations": 1}),
        "rhc_foresight": ("rhc_foresight", {}),
        "full_orientation": ("full_orientation", {}),
        "agent_alone": ("agent_alone", {}),
        "rhc_gradient": ("rhc_gradient", {}),
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
}


#: Of varga7-fast, beside the first of them.
BESIDE = "dls", "rhc, HL = 3, one iteration", "rhc, HL = 3", "rhc_foresight"


def tables(effort: Effort = FULL) -> list[Table]:
    """Times of `predict` by scenario, and interleaved with `dls`."""
    return [*(_predicting(scenario, effort) for scenario in POLICIES), _beside(effort)]


def predict_times(scenario: str = "varga7-fast", steps: int = FULL.steps) -> dict[str, tuple[float, float, float]]:
    """Times of `predict` by policy: median and 99th percentile in [s], and the median over that of a step.

    The step is that of an environment through `gym.make`, made in turn with the call of `predict`.
    """
    return {label: _episode(scenario, name, kwargs, steps) for label, (name, kwargs) in POLICIES[scenario].items()}


def stretches(steps: int = 5, scenario: str = "varga7-fast") -> dict[str, Callable[[], object]]:
    """So many calls of `predict` by each policy of :data:`BESIDE`, again and again the same ones of its own episode."""
    return {label: _stretch(scenario, *POLICIES[scenario][label], steps) for label in BESIDE}


def _predicting(scenario: str, effort: Effort) -> Table:
    return Table(
        f"predict_{scenario}",
        f"One predict in {scenario}",
        f"One arm, the first {effort.steps} steps of an episode, one policy after the other; × env.step: the median "
        "over that of a step of the environment through `gym.make`, in turn with the calls.",
        (Column("p50_us", "median", "µs"), Column("p99_us", "99th percentile", "µs"), Column("ratio", "× env.step")),
        {name: (1e6 * a, 1e6 * b, ratio) for name, (a, b, ratio) in predict_times(scenario, effort.steps).items()},
    )


def _beside(effort: Effort) -> Table:
    steps, calls = min(effort.steps, 5), stretches(min(effort.steps, 5))
    times = np.empty((20 * effort.rounds, len(calls)))
    for turn in times:
        for k, call in enumerate(calls.values()):
            begin = time.perf_counter()
            call()
            turn[k] = (time.perf_counter() - begin) / steps
    low = np.quantile(times, 0.1, axis=0)
    return Table(
        "predict_beside_dls",
        "One predict in varga7-fast, in turn with dls",
        f"The mean of {steps} calls behind the 50th of an episode, again and again, all policies in turn. 10th "
        "percentiles: what else runs on the machine only adds.",
        (Column("predict_us", "10th percentile", "µs"), Column("ratio", f"× {BESIDE[0]}")),
        {label: (1e6 * t, t / low[0]) for label, t in zip(calls, low, strict=True)},
    )


def _stretch(scenario: str, name: str, kwargs: dict[str, object], steps: int) -> Callable[[], object]:
    policy = baselines.make(name, scenario, **kwargs)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=policy.preview)
    observation, _ = env.reset(seed=0)
    state: Memory | None = None
    seen = []
    for _ in range(50 + steps):
        seen.append((observation, state))
        action, state = policy.predict(observation, state)
        observation, *_ = env.step(action)
    return lambda: [policy.predict(*one) for one in seen[-steps:]]


def _episode(scenario: str, name: str, kwargs: dict[str, object], steps: int) -> tuple[float, float, float]:
    policy = baselines.make(name, scenario, **kwargs)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=policy.preview)
    usual = gym.make("RedundantIK-v0", scenario=scenario)  # its step takes no longer where a policy looks far ahead
    observation, _ = env.reset(seed=0)
    usual.reset(seed=0)
    policy.predict(observation)
    state, times = None, np.empty((2, steps))
    for k in range(steps):
        begin = time.perf_counter()
        action, state = policy.predict(observation, state)
        between = time.perf_counter()
        usual.step(action)
        times[:, k] = between - begin, time.perf_counter() - between
        observation, *_ = env.step(action)
    predicting, stepping = np.median(times, axis=1)
    return float(predicting), float(np.quantile(times[0], 0.99)), float(predicting / stepping)
