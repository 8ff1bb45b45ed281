"""Environments for learning: the wrappers of this package in their order, around any scenario."""

from __future__ import annotations

import dataclasses
from typing import Any

import gymnasium as gym
from gymnasium.vector import AutoresetMode

from ikgym import scenarios
from ikgym.env import RedundantIKEnv
from ikgym.rl import vector, wrappers
from ikgym.rl.track import steps_ahead
from ikgym.scenarios import Scenario
from ikgym.validation import Frozen
from ikgym.vector_env import RedundantIKVectorEnv


@dataclasses.dataclass(frozen=True)
class Task(Frozen):
    """A scenario as a learning task: what is observed, what an action means, and what is rewarded.

    Args:
        scenario: A scenario or its name, see `ikgym.scenarios.find`.
        ahead: Times ahead at which the reference is shown, in [s], rising; each is at least one step.
        lost_distance: Position error in [m] at which an episode ends; None for never.
        history: Number of observations shown side by side, see :class:`ikgym.rl.History`.
        commands: Number of past commands shown.
        share: See :class:`ikgym.rl.ShareAction`.
        radian: Weight of 1 rad in [m], in observation and reward.
        zero: Distance without reward in [m].
        coarse: Unit of errors in the observation, in [m].
        fine: Unit of the hyperbolic tangent of the same, in [m].
        counted: Steps at the end of an episode whose cost is scored; None for all.
        context: Whether the observation ends with the context of the episode, see :class:`ikgym.Plant`.
    """

    scenario: str | Scenario = "learning-track"
    ahead: tuple[float, ...] = (0.01, 0.05)
    lost_distance: float | None = 0.1
    history: int = 1
    commands: int = 0
    share: float = 0.6
    radian: float = 0.3
    zero: float = 0.1
    coarse: float = 0.03
    fine: float = 0.01
    counted: int | None = None
    context: bool = False

    def arm(self, **options: Any) -> gym.Env[Any, Any]:
        """One arm, wrapped; the options are those of :class:`ikgym.RedundantIKEnv`."""
        env: gym.Env[Any, Any] = self._wrap(RedundantIKEnv(**self._arguments(), **options), wrappers)
        return env

    def arms(self, num_envs: int, **options: Any) -> Any:
        """N arms, wrapped; the options are those of :class:`ikgym.RedundantIKVectorEnv`."""
        return self._wrap(RedundantIKVectorEnv(num_envs, **self._arguments(), **options), vector)

    def _arguments(self) -> dict[str, Any]:
        """Arguments of the environment."""
        scenario = scenarios.find(self.scenario)
        shown = {"preview": steps_ahead(self.ahead, scenario.dt), "commands": self.commands}
        return {"scenario": scenario, **shown, "lost_distance": self.lost_distance}

    def _wrap(self, env: Any, kinds: Any) -> Any:
        """The environment in the wrappers of a module."""
        env = kinds.ShareAction(env, self.share)
        env = kinds.DistanceReward(env, self.radian, self.zero)
        env = kinds.TrackObservation(env, self.radian, self.coarse, self.fine, self.context)
        return env if self.history == 1 else kinds.History(env, self.history)


def make(scenario: str | Scenario, *, render_mode: str | None = None, **changes: Any) -> gym.Env[Any, Any]:
    """One arm, wrapped for learning.

    Args:
        scenario: A scenario or its name, see `ikgym.scenarios.find`.
        render_mode: None, `"human"` (a window) or `"rgb_array"`.
        changes: Fields of :class:`Task` that differ from their defaults.

    Raises:
        UnknownNameError: There is no such scenario or field.
        InvalidInputError: A value is refused.
    """
    return Task(scenario).replace(**changes).arm(render_mode=render_mode)


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
        changes: Fields of :class:`Task` that differ from their defaults.

    Raises:
        UnknownNameError: There is no such scenario, mode or field.
        InvalidInputError: A value is refused.
    """
    task = Task(scenario).replace(**changes)
    envs: gym.vector.VectorEnv[Any, Any, Any] = task.arms(
        num_envs, autoreset_mode=autoreset_mode, render_mode=render_mode
    )
    return envs
