"""Times of `predict` along an episode, one arm at a time."""

from __future__ import annotations

import time

import gymnasium as gym
import numpy as np

import baselines

STEPS = 1000
POLICIES: dict[str, tuple[str, dict[str, object]]] = {
    "follow_nominal": ("follow_nominal", {}),
    "moore_penrose": ("moore_penrose", {}),
    "dls": ("dls", {}),
    "rhc_gradient": ("rhc_gradient", {}),
    "rhc_gradient, always 450 iterations": ("rhc_gradient", {"tolerance": 0.0}),
    "rhc_gradient, analytic": ("rhc_gradient", {"gradient": "analytic"}),
}


def predict_times(scenario: str = "varga7-fast") -> dict[str, tuple[float, float]]:
    """Median and 99th percentile of the time of `predict` in [s], by policy."""
    return {label: _episode(scenario, name, kwargs) for label, (name, kwargs) in POLICIES.items()}


def _episode(scenario: str, name: str, kwargs: dict[str, object]) -> tuple[float, float]:
    policy = baselines.make(name, scenario, **kwargs)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=policy.preview)
    observation, _ = env.reset(seed=0)
    policy.predict(observation)
    state, times = None, np.empty(STEPS)
    for k in range(STEPS):
        begin = time.perf_counter()
        action, state = policy.predict(observation, state)
        times[k] = time.perf_counter() - begin
        observation, *_ = env.step(action)
    return float(np.median(times)), float(np.quantile(times, 0.99))
