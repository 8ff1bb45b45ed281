"""Environments for learning: all wrappers in their order."""

from __future__ import annotations

import dataclasses
from typing import Any

import gymnasium as gym
from gymnasium.vector import AutoresetMode

from ikgym.env import RedundantIKEnv
from ikgym.rl import vector, wrappers
from ikgym.scenarios import Preview, Scenario
from ikgym.validation import Frozen
from ikgym.vector_env import RedundantIKVectorEnv


@dataclasses.dataclass(frozen=True)
class Learning(Frozen):
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
    history: int = 1
    commands: int = 0

    def arm(self, scenario: str | Scenario, **options: Any) -> gym.Env[Any, Any]:
        """One arm of a scenario, wrapped; the options are those of :class:`ikgym.RedundantIKEnv`."""
        env: gym.Env[Any, Any] = self._wrap(RedundantIKEnv(scenario, **self._arguments(), **options), wrappers)
        return env

    def arms(self, scenario: str | Scenario, num_envs: int, **options: Any) -> Any:
        """N arms of a scenario, wrapped; the options are those of :class:`ikgym.RedundantIKVectorEnv`."""
        return self._wrap(RedundantIKVectorEnv(num_envs, scenario, **self._arguments(), **options), vector)

    def _arguments(self) -> dict[str, Any]:
        """Arguments of the environment."""
        return {"preview": self.preview, "commands": self.commands, "lost_distance": self.lost_distance}

    def _wrap(self, env: Any, kinds: Any) -> Any:
        """The environment in the wrappers of a module, in their order."""
        env = kinds.RelativeAction(env, self.share, self.largest, self.furthest)
        env = kinds.LogReward(env, self.scale, self.worst)
        env = kinds.AgentObservation(env, self.furthest)
        return env if self.history == 1 else kinds.History(env, self.history)


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
