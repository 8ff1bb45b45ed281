"""Wrappers of :class:`ikgym.RedundantIKEnv` for learning; :mod:`ikgym.rl.vector` has them for N arms at once."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from ikgym.kernels.outcome import Observation
from ikgym.rl.stages import FeatureStage, HistoryStage, LogStage, Stage, UnitStage, checked_actions, one_row
from ikgym.rl.track import DistanceStage, ShareStage, TrackStage
from ikgym.rl.view import FURTHEST, Features

FIRST, LATER = np.ones(1, dtype=np.bool_), np.zeros(1, dtype=np.bool_)


class ArmWrapper(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """A :class:`ikgym.rl.stages.Stage` around one arm, which is one row.

    Args:
        env: The environment.
        stage: The work of the wrapper.
        parameters: The parameters of the stage, recorded in the environment's `spec`.
    """

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
            self._stage.observation(one_row(observation), begun)
            return observation
        return self._stage.observation(one_row(observation), begun)[0]


class AgentObservation(ArmWrapper):
    """The observation as a learning agent sees it: bounded numbers without a scale, of shape (f,), float32.

    With the steps ahead o_1 < o_2 < … that the environment shows (its `preview`), the mean twists v_i of the reference
    from o_i to o_(i+1), their speed s = 0.02 + their root mean square, and the twist v that brings the arm to the
    reference pose at o_1 in that time, v̂ = v / s:

    | size | feature |
    |---|---|
    | w | v̂ / (0.2 + |v̂|), with |v̂| clipped at `furthest` |
    | 1 | 0.2 / (0.2 + |v̂|) |
    | n or 2 n | v̂ / (0.2 + |v̂|) times each joint's column of the Jacobian, clipped at ±10; position in \
units of a quarter of the arm's length, and orientation apart |
    | n | joint velocities in units of s (0.2 + |v̂|), clipped at ±4 |
    | 2 each | sin q_j and cos q_j of revolute joints; without joint 1 where twists are seen from its frame |
    | 1 each | q_j of prismatic joints |
    | w each | v_i / s |
    | 1 | ln s |
    | 1 | steps left, as a share of 500, at most 1; all features from the sines up to here are multiplied by 0.3 |
    | 1 each | ages of `q` and `pose` as a share of 100 steps, where sensors are slow or late |
    | h n | the last h commands, in the unit of the joint velocities, where the environment shows them |

    Twists have w components: 3 for tasks of position alone, else 6. They are expressed in the frame of joint 1, so that
    a turn of joint 1 changes none of them. Where joint 1 is prismatic, and for skew coordinates, which are no vector,
    they are expressed in the base frame.

    Args:
        env: The environment, whose observation no other wrapper has changed.
        furthest: Bound of |v̂|, above 0.

    Raises:
        InvalidInputError: The environment shows less than two reference poses, or `furthest` is out of its range.
    """

    def __init__(self, env: gym.Env[Any, Any], furthest: float = FURTHEST) -> None:
        super().__init__(env, FeatureStage(env, furthest), furthest=furthest)

    def observation(self, observation: Observation) -> Features:
        """The features of an observation. Shape (f,)."""
        features: Features = self._seen(observation, LATER)
        return features


class RelativeAction(ArmWrapper):
    """Actions relative to the required speed: joint velocity = action · share · s (0.2 + |v̂|).

    s and v̂ are those of :class:`AgentObservation`. The same action moves a slow arm slowly and a fast one fast, and
    exploration noise is in proportion to the velocity that is needed. The environment clips a joint velocity that is
    beyond its limit.

    Args:
        env: The environment, whose observation no other wrapper has changed.
        share: Share of the unit that an action of 1 means, above 0; some libraries explore with a standard deviation
            of 1.
        largest: Bound of the velocities in units, above 0; actions are clipped to ±largest / share.
        furthest: Bound of |v̂|, above 0.

    Raises:
        InvalidInputError: As in :class:`AgentObservation`, or a parameter is out of its range.
    """

    def __init__(
        self, env: gym.Env[Any, Any], share: float = 1.0, largest: float = 1.0, furthest: float = FURTHEST
    ) -> None:
        stage = UnitStage(env, share, largest, furthest)
        super().__init__(env, stage, share=share, largest=largest, furthest=furthest)


class LogReward(ArmWrapper):
    """Rewards from the logarithm of the stage cost.

        reward = scale · max(0, 1 − log(1 + stage cost) / worst)

    Stage costs span ten decades, and a critic that must distinguish 1 from 2 cannot also represent 1e9. No reward is
    negative, so an agent never gains by ending an episode.

    Args:
        env: The environment, possibly wrapped.
        scale: Reward of a step without cost, above 0.
        worst: Logarithm of the cost from which on the reward is 0, above 0.

    Raises:
        InvalidInputError: A parameter is out of its range.
    """

    def __init__(self, env: gym.Env[Any, Any], scale: float = 0.05, worst: float = 12.0) -> None:
        super().__init__(env, LogStage(env, scale, worst), scale=scale, worst=worst)


class History(ArmWrapper):
    """The last observations side by side, newest first: shape (length · f,).

    Where measurements are late or missing, earlier commands and measurements tell where the arm is now. At the
    beginning of an episode its first observation is repeated.

    Args:
        env: An environment whose observation is a vector, for example behind :class:`AgentObservation`.
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
    | n | joint coordinates from home, in half of their ranges |
    | n | joint velocities last applied, as shares of the largest |
    | 2 w each | position and orientation error to the reference at each step ahead that is shown, in units of \
`coarse`, then the hyperbolic tangent of the same in units of `fine`; 1 rad counts as `radian` |
    | 1 each | ages of `q` and `pose` in units of ten steps, where sensors are slow or late |
    | h n | the last h commands, as shares of the largest joint velocities, where the environment shows them |
    | c | the context of the episode, from -1 to 1, with `context` |

    Errors have w components, 3 for tasks of position alone, else 6. They are measured ones, seen from the frame of
    joint 1, as in :class:`AgentObservation`.

    Args:
        env: The environment, whose observation no other wrapper has changed.
        radian: Weight of 1 rad in [m], above 0.
        coarse: In [m], above 0.
        fine: In [m], above 0.
        context: Whether the context of the episode is shown.

    Raises:
        InvalidInputError: A parameter is out of its range, the arm has no home or a joint without limits, or the plant
            draws nothing from ranges.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        radian: float = 1.0,
        coarse: float = 0.1,
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
    """Rewards of size 1 from the true errors and the cost of velocities.

        reward = 1 − log(1 + (d / 1 mm)² + Φ^U) / log(1 + (D / 1 mm)²)
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
