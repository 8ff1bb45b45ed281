"""The wrappers of :mod:`ikgym.rl.wrappers` for N arms at once, bit for bit what they do one by one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorWrapper
from gymnasium.vector.utils import batch_space

from ikgym.outcome import Observation
from ikgym.rl.checks import action_box, checked_action, history_box
from ikgym.rl.feature_kernels import log_rewards
from ikgym.rl.view import FURTHEST, AgentView, Features
from ikgym.scenarios import Scenario
from ikgym.validation import BoolArray, FloatArray, number, whole_number

Seeds = int | Sequence[int | None] | None
StepReturn = tuple[Any, FloatArray, BoolArray, BoolArray, dict[str, Any]]


class ArmsWrapper(VectorWrapper[Any, Any, Any, Any, Any]):
    """What wrappers of :class:`ikgym.RedundantIKVectorEnv` have in common: rows say of themselves what they did."""

    @property
    def scenario(self) -> Scenario:
        """What is tracked."""
        scenario: Scenario = self.unwrapped.scenario  # type: ignore[attr-defined]  # of the environment
        return scenario

    def generator(self, row: int) -> tuple[np.random.Generator, int]:
        """A row's generator and its seed."""
        found: tuple[np.random.Generator, int] = self.unwrapped.generator(row)  # type: ignore[attr-defined]
        return found

    def _see(self, space: spaces.Box) -> None:
        """Has observations of this space."""
        self.single_observation_space, self.observation_space = space, batch_space(space, self.num_envs)


def beginning(options: dict[str, Any] | None, rows: int) -> BoolArray:
    """Which rows a reset with such options begins. Shape (N,)."""
    mask: BoolArray | None = (options or {}).get("reset_mask")
    return np.ones(rows, dtype=np.bool_) if mask is None else mask


class AgentObservation(ArmsWrapper):
    """:class:`ikgym.rl.AgentObservation` of N arms: features of shape (N, f), and of each last observation.

    Args:
        env: The vector environment, whose observation nothing else has changed.
        furthest: Where |v̂| is cut, above 0.
        jacobian: Whether the Jacobian is seen; not of skew coordinates.

    Raises:
        InvalidInputError: The environment shows less than two reference poses, `furthest` is out of its range, or the
            task has no such Jacobian.
    """

    def __init__(self, env: Any, furthest: float = FURTHEST, jacobian: bool = False) -> None:
        super().__init__(env)
        self._view = AgentView(env, furthest, jacobian)
        self._see(self._view.space)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Features, dict[str, Any]]:
        """Begins episodes."""
        observation, infos = self.env.reset(seed=seed, options=options)
        return self._view.see(observation), infos

    def step(self, actions: Any) -> StepReturn:
        """One step of all arms."""
        observation, rewards, terminated, truncated, infos = self.env.step(actions)
        for row in np.flatnonzero(infos.get("_final_obs", ())).tolist():
            last: Observation = {key: value[None] for key, value in infos["final_obs"][row].items()}
            infos["final_obs"][row] = self._view.see(last)[0]
        return self._view.see(observation), rewards, terminated, truncated, infos


class RelativeAction(ArmsWrapper):
    """:class:`ikgym.rl.RelativeAction` of N arms.

    Args:
        env: The vector environment, whose observation nothing else has changed.
        share: Of the unit that an action of 1 means, above 0.
        largest: Bound of the velocities in units, above 0; beyond it actions are cut.
        furthest: Where |v̂| is cut, above 0.

    Raises:
        InvalidInputError: As in :class:`AgentObservation`, or a parameter is out of its range.
    """

    def __init__(self, env: Any, share: float = 1.0, largest: float = 1.0, furthest: float = FURTHEST) -> None:
        super().__init__(env)
        self._view, self._limit = AgentView(env, furthest), self.scenario.velocity_limit
        self.single_action_space, self._share = action_box(len(self._limit), share, largest)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._unit = np.zeros(self.num_envs)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins episodes."""
        observation, infos = self.env.reset(seed=seed, options=options)
        self._unit = self._view.unit(observation)
        return observation, infos

    def step(self, actions: npt.NDArray[np.float32]) -> StepReturn:
        """One step of all arms, with actions in the unit of what is asked for."""
        velocity = checked_action(actions, self.action_space) * (self._share * self._unit)[:, None]
        observation, rewards, terminated, truncated, infos = self.env.step(velocity / self._limit)
        self._unit = self._view.unit(observation)
        return observation, rewards, terminated, truncated, infos


class LogReward(ArmsWrapper):
    """:class:`ikgym.rl.LogReward` of N arms.

    Args:
        env: The vector environment.
        scale: Above 0.
        worst: Above 0.

    Raises:
        InvalidInputError: A parameter is out of its range.
    """

    def __init__(self, env: Any, scale: float = 0.05, worst: float = 12.0) -> None:
        super().__init__(env)
        self._scale, self._worst = number("scale", scale, above=0.0), number("worst", worst, above=0.0)
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins episodes, in all rows or in those of a mask."""
        found = self.env.reset(seed=seed, options=options)
        self._ended &= ~beginning(options, self.num_envs)
        return found

    def step(self, actions: Any) -> StepReturn:
        """One step of all arms."""
        observation, rewards, terminated, truncated, infos = self.env.step(actions)
        out = np.empty(self.num_envs)
        log_rewards(rewards, self._scale, self._worst, out)
        if self.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP:
            out[self._ended] = 0.0  # these rows have begun an episode, and taken no step
        self._ended = terminated | truncated
        return observation, out, terminated, truncated, infos


class History(ArmsWrapper):
    """:class:`ikgym.rl.History` of N arms: shape (N, length · f).

    Args:
        env: A vector environment whose observations are vectors, as behind :class:`AgentObservation`.
        length: How many, at least 1.

    Raises:
        InvalidInputError: The observations are no vectors, or the length is out of its range.
    """

    def __init__(self, env: Any, length: int = 4) -> None:
        super().__init__(env)
        self._length = whole_number("length", length, at_least=1)
        space = history_box(env.single_observation_space, self._length)
        self._see(space)
        self._kept = np.zeros((self.num_envs, self._length, len(space.low) // self._length), dtype=np.float32)
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Features, dict[str, Any]]:
        """Begins episodes, in all rows or in those of a mask."""
        observation, infos = self.env.reset(seed=seed, options=options)
        rows = beginning(options, self.num_envs)
        self._begin(observation, rows)
        self._ended = self._ended & ~rows
        return self._shown, infos

    def step(self, actions: Any) -> StepReturn:
        """One step of all arms."""
        observation, rewards, terminated, truncated, infos = self.env.step(actions)
        ended, mode = terminated | truncated, self.metadata["autoreset_mode"]
        before = self._kept
        self._kept = np.concatenate([observation[:, None], before[:, :-1]], axis=1)
        if mode is AutoresetMode.SAME_STEP:
            for row in np.flatnonzero(ended).tolist():
                infos["final_obs"][row] = np.concatenate([infos["final_obs"][row], before[row, :-1].ravel()])
            self._begin(observation, ended)
        elif mode is AutoresetMode.NEXT_STEP:
            self._begin(observation, self._ended)
        self._ended = ended
        return self._shown, rewards, terminated, truncated, infos

    @property
    def _shown(self) -> Features:
        return self._kept.reshape(self.num_envs, -1).copy()

    def _begin(self, observation: Features, rows: BoolArray) -> None:
        """Fills the history of rows with their first observation."""
        self._kept[rows] = observation[rows, None]
