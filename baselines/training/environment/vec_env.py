"""The environment as agents are trained in it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnvWrapper

from baselines.agents.features import LARGEST, Features, Processing
from baselines.training.environment.view import View
from ikgym.sb3 import RedundantIKVecEnv
from ikgym.scenarios import Scenario
from ikgym.simulator import Observation
from ikgym.validation import BoolArray, known_names, number, whole_number

StepReturn = tuple[Features, npt.NDArray[np.float32], BoolArray, list[dict[str, Any]]]


def minus_cost(rewards: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """The environment's rewards, −stage cost."""
    return rewards


def minus_log(rewards: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """−log(1 + stage cost): stage costs span ten decades, and a critic that has to tell 1 from 2 must not see 1e9."""
    return -np.log1p(np.maximum(-rewards, np.float32(0.0)))


#: What agents are rewarded with, by name.
REWARDS = {"cost": minus_cost, "log": minus_log}


class ProcessedVecEnv(VecEnvWrapper):
    """N arms as an agent of :class:`baselines.agents.features.Processing` sees and moves them.

    The one processing of observations and actions: validation goes through the same :class:`view.View`, and
    evaluation computes the same features and actions by the same functions.

    | | |
    |---|---|
    | observation | `Box(-12, 12, (f,), float32)`: the features of `Processing`, which says what they are |
    | action | `Box(-1, 1, (n,), float32)`: the network output; `Processing` says which joint velocity it means, or adds to that of the base policy |
    | reward | `cost`: −stage cost; `log`: −log(1 + stage cost); times `scale` |
    | `info["terminal_observation"]` | the features at the end of the episode, so that a critic can value it |
    | `info["episode"]["r"]` | the true return, −cost of the episode, whatever the reward |

    >>> from stable_baselines3 import PPO
    >>> env = ProcessedVecEnv(16, ikgym.scenarios.get("varga7-random"), Processing(base_policy="dls", action_scale=0.5), "log")
    >>> model = PPO("MlpPolicy", env, n_steps=1000, batch_size=1000)

    Args:
        num_envs: N.
        scenario: What is to be tracked.
        processing: What the agent sees, and what the outputs of its network mean.
        reward: A name in :data:`REWARDS`.
        scale: What rewards are multiplied by, above 0.
        episode_steps: Steps after which an episode is truncated, which the agent does not foresee: it sees as many
            steps left as there would be in a whole one. Whole episodes if left out.

    Raises:
        UnknownNameError: There is no such reward, policy, or parameter of it.
        InvalidInputError: N, the scale or the length is not valid, or the policy cannot be a base policy.
    """  # noqa: E501  # a table

    def __init__(
        self,
        num_envs: int,
        scenario: Scenario,
        processing: Processing,
        reward: str = "cost",
        scale: float = 1.0,
        episode_steps: int | None = None,
    ) -> None:
        known_names("reward", [reward], REWARDS)
        self._processing, self._view = processing, View(processing, scenario)
        self._reward, self._scale = REWARDS[reward], np.float32(number("scale", scale, above=0.0))
        steps = scenario.steps
        if episode_steps is not None:
            steps = min(whole_number("episode_steps", episode_steps, at_least=1), steps)
        self._left_out = scenario.steps - steps
        super().__init__(
            RedundantIKVecEnv(num_envs, scenario.replace(steps=steps), self._view.preview),
            observation_space=spaces.Box(-LARGEST, LARGEST, (self._view.size,), np.float32),
            action_space=spaces.Box(-1.0, 1.0, (scenario.joints,), np.float32),
        )

    @property
    def processing(self) -> Processing:
        """What the agent sees, and what the outputs of its network mean."""
        return self._processing

    def reset(self) -> Features:
        """Begins episodes in all rows, see :meth:`ikgym.sb3.RedundantIKVecEnv.reset`.

        Returns:
            Shape (N, f).
        """
        observation: Any = self.venv.reset()
        return self._view.see(self._in_whole(observation), np.ones(self.num_envs, dtype=np.bool_))

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Takes network outputs for the step to come. Shape (N, n)."""
        self.venv.step_async(self._view.act(np.asarray(actions)))

    def step_wait(self) -> StepReturn:
        """Steps all arms, and begins new episodes in the rows where one has ended.

        Returns:
            Features of shape (N, f), rewards and ends of shape (N,), one info a row.
        """
        step: Any = self.venv.step_wait()
        observation, rewards, ended, infos = step
        rows = np.flatnonzero(ended)
        if len(rows):
            last = [infos[row]["terminal_observation"] for row in rows]
            final = self._view.glance(self._in_whole({key: np.stack([o[key] for o in last]) for key in last[0]}), rows)
            for row, features in zip(rows.tolist(), final, strict=True):
                infos[row]["terminal_observation"] = features
        return self._view.see(self._in_whole(observation), ended), self._scale * self._reward(rewards), ended, infos

    def _in_whole(self, observation: Observation) -> Observation:
        """An observation, with the steps that would be left."""
        return (
            {**observation, "remaining": observation["remaining"] + self._left_out} if self._left_out else observation
        )
