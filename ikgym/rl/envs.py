"""Environments for learning: one arm, or N arms that one kernel steps."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from ikgym.env import RedundantIKEnv
from ikgym.exceptions import InvalidInputError
from ikgym.options import checked_mask
from ikgym.rl.task import Task
from ikgym.rl.track import Features, Learner
from ikgym.scenarios import Scenario
from ikgym.validation import BoolArray, FloatArray, shorten
from ikgym.vector_env import RedundantIKVectorEnv

FIRST, LATER = np.ones(1, dtype=np.bool_), np.zeros(1, dtype=np.bool_)


class LearningEnv(RedundantIKEnv, gym.Env[Any, Any]):  # listed, since skrl looks for Gymnasium among the bases
    """One arm, for learning; `info` is that of :class:`ikgym.RedundantIKEnv`, whose costs are the benchmark's.

    Args:
        task: Observation, action and reward.
        render_mode: None, `"human"` (a window) or `"rgb_array"`.

    Raises:
        UnknownNameError: There is no such scenario.
        InvalidInputError: A value is refused.
    """

    def __init__(self, task: Task, render_mode: str | None = None) -> None:
        super().__init__(**_arguments(task), render_mode=render_mode)
        self.task = task
        self._learner = Learner(task, self.scenario, self.preview, self.observation_space)
        self.observation_space, self.action_space = self._learner.observation_space, self._learner.action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins an episode; for the options see :class:`ikgym.RedundantIKEnv`."""
        seen, info = super().reset(seed=seed, options=options)
        return self._learner.reset(_one_row(seen), self.context[None], FIRST)[0], info

    def step(self, action: npt.ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One step, see :class:`ikgym.rl.Task`."""
        fractions = self._learner.actions(action)
        before = self._step
        seen, cost, terminated, truncated, info = super().step(fractions)
        reward = float(self._learner.rewards(np.array([-cost]), before)[0])
        return self._learner.observe(_one_row(seen), self.context[None], LATER)[0], reward, terminated, truncated, info


class LearningVectorEnv(RedundantIKVectorEnv, gym.vector.VectorEnv[Any, Any, Any]):
    """N arms, for learning, stepped by one kernel; bit for bit a `SyncVectorEnv` of :class:`LearningEnv`.

    Args:
        num_envs: N.
        task: Observation, action and reward.
        render_fps: Pictures per second of a video.
        options: `autoreset_mode`, `render_mode` and `max_episode_steps` of :class:`ikgym.RedundantIKVectorEnv`.

    Raises:
        UnknownNameError: There is no such scenario or autoreset mode.
        InvalidInputError: A value is refused.
    """

    def __init__(self, num_envs: int, task: Task, render_fps: int | None = None, **options: Any) -> None:
        super().__init__(num_envs, **_arguments(task), **options)
        self.metadata["render_fps"] = render_fps or self.metadata["render_fps"]
        self.task, self._none = task, np.zeros(num_envs, dtype=np.bool_)
        self._learner = Learner(task, self.scenario, self.preview, self.single_observation_space, num_envs)
        self.single_observation_space = self._learner.observation_space
        self.single_action_space = self._learner.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins episodes, in all rows or in those of a mask."""
        seen, infos = super().reset(seed=seed, options=options)
        begun = checked_mask((options or {}).get("reset_mask"), self.num_envs)
        return self._learner.reset(seen, self.context, begun), infos

    def step(self, actions: npt.ArrayLike) -> tuple[Any, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """One step of all arms, see :class:`ikgym.rl.Task`."""
        fractions, waiting, begun = self._learner.actions(actions), self._ended, self._none
        before = self._simulator.steps_made.copy()
        seen, costs, terminated, truncated, infos = super().step(fractions)
        rewards = self._learner.rewards(-costs, before)
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            begun = waiting
            rewards[begun] = 0.0  # these rows have begun an episode, and taken no step
        elif "final_obs" in infos:
            begun, final = terminated | truncated, infos["final_obs"]
            rows = np.flatnonzero(begun)
            for row, last in zip(rows, self._learner.last_observations(rows, final[rows]), strict=True):
                final[row] = last
        return self._learner.observe(seen, self.context, begun), rewards, terminated, truncated, infos


def make(scenario: str | Scenario, *, render_mode: str | None = None, **changes: Any) -> gym.Env[Features, Any]:
    """One arm, for learning.

    Args:
        scenario: A scenario or its name, see `ikgym.scenarios.find`.
        render_mode: None, `"human"` (a window) or `"rgb_array"`.
        changes: Fields of :class:`Task` that differ from their defaults.

    Raises:
        UnknownNameError: There is no such scenario or field.
        InvalidInputError: A value is refused.
    """
    return LearningEnv(Task(scenario).replace(**changes), render_mode)


def make_vec(
    scenario: str | Scenario,
    num_envs: int = 1,
    *,
    autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    render_mode: str | None = None,
    **changes: Any,
) -> gym.vector.VectorEnv[Any, Any, Any]:
    """N arms, for learning, stepped by one kernel; bit for bit a `SyncVectorEnv` of :func:`make`.

    Args:
        scenario: A scenario or its name, see `ikgym.scenarios.find`.
        num_envs: N.
        autoreset_mode: A mode of Gymnasium, or its value such as ``"SameStep"``.
        render_mode: None or `"rgb_array"`.
        changes: Fields of :class:`Task` that differ from their defaults.

    Raises:
        UnknownNameError: There is no such scenario, mode or field.
        InvalidInputError: A value is refused.
    """
    task = Task(scenario).replace(**changes)
    return LearningVectorEnv(num_envs, task, autoreset_mode=autoreset_mode, render_mode=render_mode)


def _arguments(task: Any) -> dict[str, Any]:
    if not isinstance(task, Task):
        raise InvalidInputError(
            f"task: expected an object of Task, got {shorten(task)}; ikgym.rl.make and make_vec take a scenario."
        )
    return task.arguments()


def _one_row(seen: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """An observation without a row axis as that of one row."""
    return {key: value[None] for key, value in seen.items()}
