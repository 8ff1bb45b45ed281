"""Wrappers of :class:`ikgym.RedundantIKEnv` for learning; :mod:`ikgym.rl.vector` has them for N arms at once."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from ikgym.rl.stages import HistoryStage, Stage, checked_actions, one_row
from ikgym.rl.track import DistanceStage, ShareStage, TrackStage

FIRST, LATER = np.ones(1, dtype=np.bool_), np.zeros(1, dtype=np.bool_)


class ArmWrapper(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """A :class:`ikgym.rl.stages.Stage` around one arm, which is one row; `spec` records its parameters."""

    def __init__(self, env: gym.Env[Any, Any], stage: Stage, **parameters: Any) -> None:
        RecordConstructorArgs.__init__(self, **parameters)
        super().__init__(env)
        self._stage = stage
        if stage.observation_space is not None:
            self.observation_space = stage.observation_space
        if stage.action_space is not None:
            self.action_space = stage.action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._seen(observation, FIRST), info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One step of the environment."""
        if self._stage.action_space is not None:
            action = self._stage.action(checked_actions(action, self.action_space)[None])[0]
        observation, reward, terminated, truncated, info = self.env.step(action)
        reward = self._stage.reward(np.array([float(reward)]), lambda key: np.array([info[key]]))[0].item()
        return self._seen(observation, LATER), reward, terminated, truncated, info

    def _seen(self, observation: Any, begun: Any) -> Any:
        if self._stage.observation_space is None:
            return observation
        return self._stage.observation(one_row(observation), begun)[0]


class History(ArmWrapper):
    """The last observations side by side, newest first: shape (length · f,).

    Where measurements are late or missing, earlier commands and measurements tell where the arm is now. At the
    beginning of an episode its first observation is repeated.

    Args:
        env: An environment whose observation is a vector, for example behind :class:`TrackObservation`.
        length: Number of observations, at least 1.

    Raises:
        InvalidInputError: The observation is no vector, or the length is out of its range.
    """

    def __init__(self, env: gym.Env[Any, Any], length: int = 4) -> None:
        super().__init__(env, HistoryStage(env, length), length=length)


class TrackObservation(ArmWrapper):
    """The observation for learning without a model: numbers of size 1, at most 5, of shape (f,), float32.

    | size | feature |
    |---|---|
    | n | joint coordinates from home in [rad], of prismatic joints in half of their ranges |
    | n | joint velocities last applied, as shares of the largest |
    | 2 w each | position and orientation error to the reference at each step ahead that is shown, in units of \
`coarse`, then the hyperbolic tangent of the same in units of `fine`; 1 rad counts as `radian` |
    | 1 each | ages of `q` and `pose` in units of ten steps, where sensors are slow or late |
    | h n | the last h commands, as shares of the largest joint velocities, where the environment shows them |
    | c | the context of the episode, from -1 to 1, with `context` |

    Errors have w components, 3 for tasks of position alone, else 6. They are measured ones, seen from the frame of
    joint 1, so that a turn of joint 1 changes none of them; from the base frame where joint 1 is prismatic, and for
    skew coordinates, which are no vector. Without a home joints are seen from the middle of their range, or from 0;
    half of a range is 1 m where a prismatic joint has none.

    Args:
        env: The environment, whose observation no other wrapper has changed.
        radian: Weight of 1 rad in [m], above 0.
        coarse: In [m], above 0.
        fine: In [m], above 0.
        context: Whether the context of the episode is shown.

    Raises:
        InvalidInputError: A parameter is out of its range, the observation was changed, or the plant draws nothing from
            ranges.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        radian: float = 1.0,
        coarse: float = 0.03,
        fine: float = 0.01,
        context: bool = False,
    ) -> None:
        stage = TrackStage(env, radian, coarse, fine, context)
        super().__init__(env, stage, radian=radian, coarse=coarse, fine=fine, context=context)


class ShareAction(ArmWrapper):
    """Actions of ±1 as a share of the largest joint velocities, those that arm and scenario allow.

    Args:
        env: The environment.
        share: Above 0.

    Raises:
        InvalidInputError: The share is out of its range.
    """

    def __init__(self, env: gym.Env[Any, Any], share: float = 1.0) -> None:
        super().__init__(env, ShareStage(env, share), share=share)


class DistanceReward(ArmWrapper):
    """Rewards of size 1 from the true errors and the costs of velocities and, where the scenario has it, proximity.

        reward = 1 − log(1 + (d / 1 mm)² + Φ^U + Φ^C) / log(1 + (D / 1 mm)²)
        d² = (position error)² + (L · orientation error)²

    With L = 1 m, Δx = 1 mm and P_X = 2 this is 1 − log(1 + stage cost) / log(1 + (D / 1 mm)²). It is negative beyond D.

    Args:
        env: The environment, possibly wrapped.
        radian: L in [m], at least 0.
        zero: D in [m], above 0.

    Raises:
        InvalidInputError: A parameter is out of its range.
    """

    def __init__(self, env: gym.Env[Any, Any], radian: float = 1.0, zero: float = 0.1) -> None:
        super().__init__(env, DistanceStage(env, radian, zero), radian=radian, zero=zero)
