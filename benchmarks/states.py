"""States along an episode, at which solvers are compared: the same for all."""

from __future__ import annotations

import gymnasium as gym
import numpy as np

import baselines
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

Observation = dict[str, FloatArray]


def along(scenario: Scenario, preview: int, count: int, lead: int) -> list[list[Observation]]:
    """States of an episode of a receding horizon, evenly spread, each at the end of the steps that lead to it.

    The episode is one of `rhc` with as many steps ahead: where a horizon of that length leads, and not where another
    policy does, is where its solver has to be fast.

    Args:
        scenario: What is tracked.
        preview: Steps of the nominal trajectory that the observations show.
        count: The number of states.
        lead: Steps shown before each of them.

    Returns:
        Per state the ``lead + 1`` observations up to it.
    """
    policy = baselines.make("rhc", scenario, horizon=preview + 1)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=preview)
    observation, _ = env.reset(seed=0)
    ends = np.linspace(0, scenario.steps, count + 2).astype(int)[1:-1]
    episode, state = [], None
    for _ in range(int(ends[-1]) + 1):
        episode.append({key: np.array(value) for key, value in observation.items()})
        action, state = policy.predict(observation, state)
        observation, *_ = env.step(action)
    return [episode[max(end - lead, 0) : end + 1] for end in ends]
