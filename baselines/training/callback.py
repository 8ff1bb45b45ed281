"""A callback for training with Stable-Baselines3: scores on the validation split in its logs."""

from __future__ import annotations

from typing import Any

from stable_baselines3.common.callbacks import BaseCallback

from baselines.agents.policy import Agent
from baselines.policy import Problem
from baselines.training.exporting import exported
from baselines.training.validation import score
from ikgym.exceptions import InvalidInputError
from ikgym.sb3 import LearningVecEnv, RedundantIKVecEnv
from ikgym.scenarios import Scenario
from ikgym.validation import whole_number


class ValidationCallback(BaseCallback):
    """Plays episodes of the validation split at intervals, and logs their costs and errors.

    | in TensorBoard | meaning |
    |---|---|
    | `validation/cost` | geometric mean of the costs |
    | `validation/cost_ratio` | the same over the reference costs of `ikgym train`; absent where there are none |
    | `validation/position_error_max_mm` | mean over the episodes of their largest position error |
    | `validation/orientation_error_max_mrad` | the same of the orientation; absent where the task has none |

    Stable-Baselines3 itself logs `rollout/ep_rew_mean`, the mean return of the last training episodes.

    >>> model = PPO("MlpPolicy", ikgym.sb3.make_vec("panda-random", 8), tensorboard_log="runs/mine")
    >>> model.learn(1_000_000, callback=ValidationCallback(every=100_000))

    Args:
        every: Steps of training, those of all arms together, between two validations.
        episodes: Number of episodes; a deterministic scenario has one.
        scenario: The scenario of the validation; that of the training if left out.

    Raises:
        InvalidInputError: A number is not valid.
    """

    def __init__(self, every: int, episodes: int = 8, scenario: Scenario | None = None) -> None:
        super().__init__()
        self._every = whole_number("every", every, at_least=1)
        self._episodes, self._scenario, self._due = whole_number("episodes", episodes, at_least=1), scenario, 0

    def _on_step(self) -> bool:
        if self.num_timesteps >= self._due:
            self._due = self.num_timesteps + self._every
            for name, value in self._measured().items():
                if isinstance(value, float):
                    self.logger.record(f"validation/{name}", value)
        return True

    def _measured(self) -> dict[str, Any]:
        envs: Any = self.training_env
        if not isinstance(envs, RedundantIKVecEnv):
            raise InvalidInputError(
                f"env: expected one of ikgym.sb3, unwrapped, got {type(envs).__name__}; validate others by "
                "baselines.evaluate.evaluate(scenario, [model], wrap=…)."
            )
        scenario = self._scenario or envs.scenario
        if not isinstance(envs, LearningVecEnv):
            return score(self.model, scenario, self._episodes, envs.preview).to_json()
        policy = Agent(Problem.of(scenario), given=exported(self.model, envs))
        return score(policy, scenario, self._episodes, policy.preview).to_json()
