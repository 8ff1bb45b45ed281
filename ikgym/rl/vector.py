"""The wrappers of :mod:`ikgym.rl.wrappers` for N arms at once, bit for bit the same row by row."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from gymnasium.vector import AutoresetMode, VectorWrapper
from gymnasium.vector.utils import batch_space

from ikgym.rl.stages import HistoryStage, Stage, checked_actions
from ikgym.rl.track import DistanceStage, ShareStage, TrackStage
from ikgym.scenarios import Scenario
from ikgym.validation import BoolArray, FloatArray


class ArmsWrapper(VectorWrapper[Any, Any, Any, Any, Any]):
    """A :class:`ikgym.rl.stages.Stage` around :class:`ikgym.RedundantIKVectorEnv`, in all autoreset modes.

    Args:
        env: The vector environment.
        parameters: As the wrapper of the same name in :mod:`ikgym.rl.wrappers` takes them.

    Raises:
        InvalidInputError: See there.
    """

    stage: ClassVar[Callable[..., Stage]]

    def __init__(self, env: Any, *args: Any, **parameters: Any) -> None:
        super().__init__(env)
        self._stage = type(self).stage(env, *args, **parameters)
        # An attribute as well as an entry of the metadata, as Gymnasium's SyncVectorEnv has it.
        self.autoreset_mode: AutoresetMode = self.metadata["autoreset_mode"]
        self._ended = self._none = np.zeros(self.num_envs, dtype=np.bool_)
        if self._stage.observation_space is not None:
            self.single_observation_space = self._stage.observation_space
            self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        if self._stage.action_space is not None:
            self.single_action_space = self._stage.action_space
            self.action_space = batch_space(self.single_action_space, self.num_envs)

    @property
    def scenario(self) -> Scenario:
        """The tracking problem."""
        scenario: Scenario = self.unwrapped.scenario  # type: ignore[attr-defined]  # of the environment
        return scenario

    def generator(self, row: int) -> tuple[np.random.Generator, int]:
        """A row's generator and its seed."""
        found: tuple[np.random.Generator, int] = self.unwrapped.generator(row)  # type: ignore[attr-defined]
        return found

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins episodes, in all rows or in those of a mask."""
        observation, infos = self.env.reset(seed=seed, options=options)
        mask: BoolArray | None = (options or {}).get("reset_mask")
        begun = np.ones(self.num_envs, dtype=np.bool_) if mask is None else mask
        self._ended = self._ended & ~begun
        return self._stage.reset(observation, begun), infos

    def step(self, actions: Any) -> tuple[Any, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """One step of all arms."""
        if self._stage.action_space is not None:
            actions = self._stage.action(checked_actions(actions, self.action_space))
        observation, rewards, terminated, truncated, infos = self.env.step(actions)
        ended, begun = terminated | truncated, self._none
        rewards = self._stage.reward(rewards, functools.partial(_told, infos, self.num_envs))
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            begun = self._ended
            rewards[begun] = 0.0  # these rows have begun an episode, and taken no step
        elif self.autoreset_mode is AutoresetMode.SAME_STEP and "final_obs" in infos:
            begun, rows, final = ended, np.flatnonzero(ended), infos["final_obs"]
            for row, last in zip(rows, self._stage.last_observations(rows, final[rows]), strict=True):
                final[row] = last
        self._ended = ended
        return self._stage.observation(observation, begun), rewards, terminated, truncated, infos


class History(ArmsWrapper):
    """:class:`ikgym.rl.History` of N arms: shape (N, length · f)."""

    stage = HistoryStage


class TrackObservation(ArmsWrapper):
    """:class:`ikgym.rl.TrackObservation` of N arms: features of shape (N, f)."""

    stage = TrackStage


class ShareAction(ArmsWrapper):
    """:class:`ikgym.rl.ShareAction` of N arms."""

    stage = ShareStage


class DistanceReward(ArmsWrapper):
    """:class:`ikgym.rl.DistanceReward` of N arms."""

    stage = DistanceStage


def _told(infos: dict[str, Any], rows: int, key: str) -> FloatArray:
    """A value of the step just made, also of rows whose next episode has begun since; 0 without a step. Shape (N,)."""
    found: FloatArray = infos.get(key, np.zeros(rows))
    final = infos.get("final_info", {}).get(key)
    return found if final is None else np.where(infos["_final_info"], final, found)
