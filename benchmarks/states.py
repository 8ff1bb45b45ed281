"""States along an episode, at which solvers are compared: the same for all."""

from __future__ import annotations

import gymnasium as gym
import numpy as np

import baselines
from ikgym.arms import Arm
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


def rows_along(scenario: Scenario, preview: int, rows: int, lead: int) -> list[Observation]:
    """The same for a batch of arms, each on its own way: the ``lead + 1`` observations behind the 50th step."""
    policy = baselines.make("rhc", scenario, horizon=preview + 1)
    envs = gym.make_vec("RedundantIK-v0", num_envs=rows, scenario=scenario, preview=preview)
    observation, _ = envs.reset(seed=0)
    out, state = [], None
    for _ in range(50 + lead):
        out.append({key: np.array(value) for key, value in observation.items()})
        action, state = policy.predict(observation, state)
        observation, *_ = envs.step(action)
    return out[49:]


def chain(joints: int) -> Arm:
    """An arm of n links of 0.3 m, whose joints turn about z, y and x in turn."""
    offsets = np.tile([0.0, 0.0, 0.3], (joints, 1))
    axes = np.eye(3)[[2, 1, 0] * joints][:joints]
    return Arm(f"chain{joints}", offsets, axes, tool=np.array([0.1, 0.0, 0.3]))
