"""N arms wrapped for learning by :mod:`ikgym.rl`, as trainers step them."""

from __future__ import annotations

from typing import Any

from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from baselines.agents.features import Features
from baselines.training.environment.view import aligned
from baselines.training.gradients.arms import spread_steps
from ikgym.rl import Learning
from ikgym.sb3 import LearningVecEnv
from ikgym.scenarios import Scenario


class SpreadVecEnv(VecEnvWrapper):
    """:class:`ikgym.sb3.LearningVecEnv`, whose arms a reset spreads over their episodes.

    An update then sees all parts of an episode, not one of them in all arms. Trajectories that are no joint path are
    begun at their beginning.

    Args:
        num_envs: N.
        scenario: What is to be tracked.
        learning: How it is wrapped.

    Raises:
        InvalidInputError: A value is refused.
    """

    def __init__(self, num_envs: int, scenario: Scenario, learning: Learning) -> None:
        super().__init__(LearningVecEnv(num_envs, scenario, learning))
        first = spread_steps(scenario, num_envs)
        self._first = [{"step": step} for step in first.tolist()] if first.any() else None

    def reset(self) -> Features:
        """The first features. Shape (N, f)."""
        if self._first is not None:
            self.venv.set_options(self._first)
        features: Any = self.venv.reset()
        return aligned(features)

    def step_wait(self) -> VecEnvStepReturn:
        """See :meth:`ikgym.sb3.RedundantIKVecEnv.step_wait`."""
        step: Any = self.venv.step_wait()
        return aligned(step[0]), *step[1:]
