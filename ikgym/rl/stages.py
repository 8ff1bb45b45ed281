"""The work of each wrapper on N rows; a single environment is one row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from ikgym.exceptions import InvalidInputError
from ikgym.validation import BoolArray, FloatArray, shortened, whole_number

Rows = npt.NDArray[np.int64]
#: Values of `info` by key, for the steps that are rewarded. Shape (N,).
Told = Callable[[str], FloatArray]


class Stage:
    """The work of one wrapper. This base changes nothing; each hook is overridden where needed.

    Attributes:
        observation_space: Space of one row's observation, None where it is that of the environment.
        action_space: Space of one row's action, None where it is that of the environment.
    """

    observation_space: spaces.Box | None = None
    action_space: spaces.Box | None = None

    def observation(self, observation: Any, begun: BoolArray) -> Any:
        """The observation of N rows, from that of the environment and the rows whose episodes have begun, (N,)."""
        del begun
        return observation

    def reset(self, observation: Any, begun: BoolArray) -> Any:
        """The observation of N rows after a reset; where no episode has begun, it is the one of the last step."""
        return self.observation(observation, begun)

    def last_observations(self, rows: Rows, observations: Sequence[Any]) -> Sequence[Any]:
        """The last observations of k rows whose next episodes have begun in the same step."""
        del rows
        return observations

    def action(self, actions: FloatArray) -> FloatArray:
        """The environment's actions. Shapes (N, n)."""
        return actions

    def reward(self, rewards: FloatArray, told: Told) -> FloatArray:
        """The rewards of N rows, from those of the environment, and costs and errors of the same step."""
        del told
        return rewards


class HistoryStage(Stage):
    """See :class:`ikgym.rl.History`."""

    def __init__(self, env: Any, length: int = 4) -> None:
        space = getattr(env, "single_observation_space", env.observation_space)
        self._length = whole_number("length", length, at_least=1)
        if not isinstance(space, spaces.Box) or len(space.shape) != 1:
            raise InvalidInputError(
                f"History: expected an environment whose observation is a vector, got {shortened(space)}."
            )
        low, high = np.tile(space.low, self._length), np.tile(space.high, self._length)
        self.observation_space = spaces.Box(low, high, dtype=np.float32)
        self._kept: npt.NDArray[np.float32] = np.zeros((getattr(env, "num_envs", 1), self._length, *space.shape), "f4")

    def observation(self, observation: Any, begun: BoolArray) -> Any:
        """The last observations, newest first. Shape (N, length · f)."""
        self._kept = np.concatenate([observation[:, None], self._kept[:, :-1]], axis=1)
        return self.reset(observation, begun)

    def reset(self, observation: Any, begun: BoolArray) -> Any:
        """The first observation of an episode, repeated. Shape (N, length · f)."""
        self._kept[begun] = observation[begun, None]
        return self._kept.reshape(len(observation), -1).copy()

    def last_observations(self, rows: Rows, observations: Sequence[Any]) -> Sequence[Any]:
        """The last observation of each episode and those before it. Shapes (length · f,)."""
        before = self._kept[rows, :-1].reshape(len(rows), -1)
        return list(np.concatenate([np.stack(observations), before], axis=1))


def one_row(observation: Any) -> Any:
    """An observation without a row axis as that of one row."""
    if isinstance(observation, dict):
        return {key: value[None] for key, value in observation.items()}
    return np.asarray(observation)[None]


def checked_actions(actions: npt.ArrayLike, space: Any) -> FloatArray:
    """Actions clipped to their box, as float64."""
    raw = np.asarray(actions)
    if raw.dtype.kind not in "fiub" or raw.shape != space.shape:
        raise InvalidInputError(f"action: expected numbers of shape {space.shape}, got {shortened(actions)}.")
    out: FloatArray = np.clip(raw.astype(np.float64), space.low, space.high)
    return out
