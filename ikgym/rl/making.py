"""Environments for learning: all wrappers in their order."""

from __future__ import annotations

import abc
import dataclasses
from typing import Any, ClassVar

import gymnasium as gym
from gymnasium.vector import AutoresetMode

from ikgym.env import RedundantIKEnv
from ikgym.rl import vector, wrappers
from ikgym.scenarios import Preview, Scenario
from ikgym.validation import Frozen
from ikgym.vector_env import RedundantIKVectorEnv


@dataclasses.dataclass(frozen=True)
class Wrapping(Frozen, abc.ABC):
    """What all wrapped environments have in common; for the fields see :class:`Learning`."""

    preview: Preview = (1,)
    lost_distance: float | None = None
    history: int = 1
    commands: int = 0

    #: Whether episodes are entered where the last one was lost.
    reentry: ClassVar[bool]

    def arm(self, scenario: str | Scenario, **options: Any) -> gym.Env[Any, Any]:
        """One arm of a scenario, wrapped; the options are those of :class:`ikgym.RedundantIKEnv`."""
        env: gym.Env[Any, Any] = self._whole(RedundantIKEnv(scenario, **self._arguments(), **options), wrappers)
        return env

    def arms(self, scenario: str | Scenario, num_envs: int, **options: Any) -> Any:
        """N arms of a scenario, wrapped; the options are those of :class:`ikgym.RedundantIKVectorEnv`."""
        return self._whole(RedundantIKVectorEnv(num_envs, scenario, **self._arguments(), **options), vector)

    def _arguments(self) -> dict[str, Any]:
        """Arguments of the environment."""
        shown = {"preview": self.preview, "commands": self.commands}
        return {**shown, "lost_distance": self.lost_distance, "reentry": self.reentry}

    def _whole(self, env: Any, kinds: Any) -> Any:
        """The environment in all wrappers."""
        env = self._wrap(env, kinds)
        return env if self.history == 1 else kinds.History(env, self.history)

    @abc.abstractmethod
    def _wrap(self, env: Any, kinds: Any) -> Any:
        """The environment in the wrappers of a module, in their order, up to the features."""


@dataclasses.dataclass(frozen=True)
class Learning(Wrapping):
    """Settings of the wrappers for learning.

    The defaults suit PPO of Stable-Baselines3 with its own defaults. With a lead of ten steps, a joint within its
    acceleration limit can follow; with |v̂| clipped at 5, an arm that is far off returns gradually. Exploration noise
    with a standard deviation of 1 is as large as the required velocity: with less, the effect of one action is lost
    among those of the others. Episodes end at 0.01 m: at 0.1 m most steps were far from the path, where nothing is
    learned about staying on it.

    Args:
        preview: Steps ahead at which the reference is shown, at least two; the first one is the lead.
        lost_distance: Position error in [m] at which an episode ends; None for never.
        share: See :class:`ikgym.rl.RelativeAction`.
        largest: See there.
        furthest: See there.
        scale: See :class:`ikgym.rl.LogReward`.
        worst: See there.
        history: Number of observations shown side by side, see :class:`ikgym.rl.History`.
        commands: Number of past commands shown.
    """

    preview: Preview = (10, 40, 100)
    lost_distance: float | None = 0.01
    share: float = 1.0
    largest: float = 2.0
    furthest: float = 5.0
    scale: float = 0.05
    worst: float = 12.0

    reentry = True

    def _wrap(self, env: Any, kinds: Any) -> Any:
        env = kinds.RelativeAction(env, self.share, self.largest, self.furthest)
        env = kinds.LogReward(env, self.scale, self.worst)
        return kinds.AgentObservation(env, self.furthest)


@dataclasses.dataclass(frozen=True)
class Task(Wrapping):
    """The tracking problem and the wrappers of an environment by id, see :mod:`ikgym.rl.ids`.

    Args:
        scenario: Name of the scenario.
        preview: Steps ahead at which the reference is shown.
        lost_distance: Position error in [m] at which an episode ends; None for never.
        history: Number of observations shown side by side.
        commands: Number of past commands shown.
        share: See :class:`ikgym.rl.ShareAction`.
        radian: Weight of 1 rad in [m], in observation and reward.
        zero: Distance without reward in [m], also the coarse unit of errors in the observation.
        fine: Fine unit of errors in the observation, in [m].
        counted: Steps at the end of an episode whose cost is scored; None for all.
        context: Whether the observation ends with the context of the episode, see :class:`ikgym.Plant`.
    """

    scenario: str = "learning-track"
    preview: Preview = (1, 5)
    lost_distance: float | None = 0.1
    share: float = 0.6
    radian: float = 0.3
    zero: float = 0.1
    fine: float = 0.01
    counted: int | None = None
    context: bool = False

    reentry = False

    def _wrap(self, env: Any, kinds: Any) -> Any:
        env = kinds.ShareAction(env, self.share)
        env = kinds.DistanceReward(env, self.radian, self.zero)
        return kinds.TrackObservation(env, self.radian, self.zero, self.fine, self.context)


def make(scenario: str | Scenario, *, render_mode: str | None = None, **changes: Any) -> gym.Env[Any, Any]:
    """One arm, wrapped for learning.

    Args:
        scenario: A scenario or its name, see `ikgym.scenarios.find`.
        render_mode: None, `"human"` (a window) or `"rgb_array"`.
        changes: Fields of :class:`Learning` that differ from their defaults.

    Raises:
        UnknownNameError: There is no such scenario or field.
        InvalidInputError: A value is refused.
    """
    return Learning().replace(**changes).arm(scenario, render_mode=render_mode)


def make_vec(
    scenario: str | Scenario,
    num_envs: int = 1,
    *,
    autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    render_mode: str | None = None,
    **changes: Any,
) -> gym.vector.VectorEnv[Any, Any, Any]:
    """N arms, wrapped for learning and stepped by one kernel; bit for bit a `SyncVectorEnv` of :func:`make`.

    Args:
        scenario: A scenario or its name, see `ikgym.scenarios.find`.
        num_envs: N.
        autoreset_mode: A mode of Gymnasium, or its value such as ``"SameStep"``.
        render_mode: None or `"rgb_array"`.
        changes: Fields of :class:`Learning` that differ from their defaults.

    Raises:
        UnknownNameError: There is no such scenario, mode or field.
        InvalidInputError: A value is refused.
    """
    learning = Learning().replace(**changes)
    envs: gym.vector.VectorEnv[Any, Any, Any] = learning.arms(
        scenario, num_envs, autoreset_mode=autoreset_mode, render_mode=render_mode
    )
    return envs
