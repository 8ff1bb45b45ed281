"""Wrappers of :class:`ikgym.RedundantIKEnv` for learning; :mod:`ikgym.rl.vector` has them for N arms at once."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.utils import RecordConstructorArgs

from ikgym.outcome import Observation
from ikgym.rl.checks import action_box, checked_action, history_box
from ikgym.rl.feature_kernels import log_rewards
from ikgym.rl.view import FURTHEST, AgentView, Features, batched
from ikgym.validation import number, whole_number

StepReturn = tuple[Any, float, bool, bool, dict[str, Any]]


class AgentObservation(gym.ObservationWrapper[Features, Any, Observation], RecordConstructorArgs):
    """What an agent sees: bounded numbers without a scale, of shape (f,), float32.

    With the steps ahead o_1 < o_2 < … that the environment shows (its `preview`), the mean twists v_i of the reference
    from o_i to o_(i+1), their speed s, which is 0.02 and their root mean square, and the twist v that brings the arm to
    the reference pose at o_1 in that time, v̂ = v / s:

    | number | feature |
    |---|---|
    | w | v̂ / (0.2 + |v̂|), with |v̂| cut at `furthest` |
    | 1 | 0.2 / (0.2 + |v̂|) |
    | n or 2 n | what each joint can do about it: v̂ / (0.2 + |v̂|) times its column of the Jacobian, position in \
units of a quarter of the arm's length and orientation apart, cut at ±10 |
    | n | joint velocities in units of s (0.2 + |v̂|), cut at ±4 |
    | 2 each | sin q_j and cos q_j of revolute joints, but for joint 1 where twists are seen from its frame |
    | 1 each | q_j of prismatic joints |
    | w each | v_i / s |
    | 1 | ln s |
    | 1 | steps left, as a share of 500, at most 1; from the sines on all are multiplied by 0.3 up to here |
    | 1 each | ages of `q` and `pose` as a share of 100 steps, where sensors are slow or late |
    | h n | the last h commands, like the joint velocities, where the environment shows them |
    | w n | the Jacobian of the twist row by row, in [m] and without a unit, where it is asked for |

    Twists have w components: 3 for tasks of position alone, else 6. They are seen from the frame of joint 1, which a
    turn of joint 1 does not change, so that nothing has to be learned twice; where joint 1 is prismatic and for skew
    coordinates, which are no vector, they stay in the base frame.

    Args:
        env: The environment, whose observation nothing else has changed.
        furthest: Where |v̂| is cut, above 0.
        jacobian: Whether the Jacobian is seen; not of skew coordinates.

    Raises:
        InvalidInputError: The environment shows less than two reference poses, `furthest` is out of its range, or the
            task has no such Jacobian.
    """

    def __init__(self, env: gym.Env[Any, Any], furthest: float = FURTHEST, jacobian: bool = False) -> None:
        RecordConstructorArgs.__init__(self, furthest=furthest, jacobian=jacobian)
        super().__init__(env)
        self._view = AgentView(env, furthest, jacobian)
        self.observation_space = self._view.space

    def observation(self, observation: Observation) -> Features:
        """The features of an observation. Shape (f,)."""
        out: Features = self._view.see(batched(observation))[0]
        return out


class RelativeAction(gym.Wrapper[Any, Any, Observation, Any], RecordConstructorArgs):
    """Actions in the unit of what is asked for: joint velocity = action · share · s (0.2 + |v̂|).

    s and v̂ are those of :class:`AgentObservation`. The same action moves a slow arm slowly and a fast one fast, and
    noise of exploration is in proportion to the velocity that is needed, which ends where the arm is on its path at
    rest. A joint whose velocity is beyond its limit is clipped by the environment.

    Args:
        env: The environment, whose observation nothing else has changed.
        share: Of the unit that an action of 1 means, above 0: noise has a standard deviation of 1 in some libraries.
        largest: Bound of the velocities in units, above 0; actions are within ±largest / share, and cut beyond.
        furthest: Where |v̂| is cut, above 0.

    Raises:
        InvalidInputError: As in :class:`AgentObservation`, or a parameter is out of its range.
    """

    def __init__(
        self, env: gym.Env[Any, Any], share: float = 1.0, largest: float = 1.0, furthest: float = FURTHEST
    ) -> None:
        RecordConstructorArgs.__init__(self, share=share, largest=largest, furthest=furthest)
        super().__init__(env)
        self._view, self._limit = AgentView(env, furthest), env.unwrapped.scenario.velocity_limit  # type: ignore[attr-defined]
        self.action_space, self._share = action_box(len(self._limit), share, largest)
        self._unit = 0.0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins an episode, as the environment does."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._unit = self._view.unit(batched(observation))[0]
        return observation, info

    def step(self, action: npt.NDArray[np.float32]) -> StepReturn:
        """One step of the environment, with an action in the unit of what is asked for."""
        velocity = checked_action(action, self.action_space) * (self._share * self._unit)
        observation, reward, terminated, truncated, info = self.env.step(velocity / self._limit)
        self._unit = self._view.unit(batched(observation))[0]
        return observation, float(reward), terminated, truncated, info


class LogReward(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """What is left of a step's worth after the logarithm of its cost.

        reward = scale · max(0, 1 − log(1 + stage cost) / worst)

    Stage costs span ten decades, and a critic that has to tell 1 from 2 must not see 1e9. No reward is negative, so
    that an agent gains nothing by ending an episode: where a track is lost, it loses what later steps would be worth.

    Args:
        env: The environment, or one around it.
        scale: Reward of a step without cost, above 0.
        worst: Logarithm of a cost from which on a step is worth nothing, above 0.

    Raises:
        InvalidInputError: A parameter is out of its range.
    """

    def __init__(self, env: gym.Env[Any, Any], scale: float = 0.05, worst: float = 12.0) -> None:
        RecordConstructorArgs.__init__(self, scale=scale, worst=worst)
        super().__init__(env)
        self._scale, self._worst = number("scale", scale, above=0.0), number("worst", worst, above=0.0)

    def step(self, action: Any) -> StepReturn:
        """One step of the environment."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        out = np.empty(1)
        log_rewards(np.array([float(reward)]), self._scale, self._worst, out)
        return observation, out[0].item(), terminated, truncated, info


class History(gym.Wrapper[Any, Any, Features, Any], RecordConstructorArgs):
    """The last observations side by side, newest first: shape (length · f,).

    Where measurements are late or missing, what an arm was told and showed before says where it is by now. Before there
    were as many, the first one of the episode stands in their place.

    Args:
        env: An environment whose observation is a vector, as behind :class:`AgentObservation`.
        length: How many, at least 1.

    Raises:
        InvalidInputError: The observation is no vector, or the length is out of its range.
    """

    def __init__(self, env: gym.Env[Any, Any], length: int = 4) -> None:
        RecordConstructorArgs.__init__(self, length=length)
        super().__init__(env)
        self._length = whole_number("length", length, at_least=1)
        self.observation_space = history_box(env.observation_space, self._length)
        self._kept = np.zeros((self._length, 0), dtype=np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Features, dict[str, Any]]:
        """Begins an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._kept = np.repeat(observation[None], self._length, axis=0)
        return self._kept.ravel(), info

    def step(self, action: Any) -> StepReturn:
        """One step of the environment."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._kept = np.concatenate([observation[None], self._kept[:-1]])
        return self._kept.ravel(), float(reward), terminated, truncated, info
