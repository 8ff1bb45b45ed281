"""Models of Stable-Baselines3 that learn from rewards, segment by segment."""

from __future__ import annotations

import abc
import contextlib
import copy
from collections.abc import Iterator
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import FloatSchedule
from stable_baselines3.common.vec_env import VecEnv
from torch import nn

from baselines.agents.bilinear.processing import Bilinear
from baselines.training.config.reinforcement import Reinforcement
from baselines.training.environment.inverse_env import InverseVecEnv
from baselines.training.environment.learning_env import SpreadVecEnv
from baselines.training.environment.vec_env import ProcessedVecEnv
from baselines.training.randomness import episode_seed
from baselines.training.score import Score
from baselines.training.trainer import SegmentMetrics
from baselines.training.trainers.initial_weights import begin_from
from baselines.training.trainers.models import score_of_model
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: What a model counts.
COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")


class ReinforcementTrainer(abc.ABC):
    """A model of Stable-Baselines3 that learns segment by segment, see :class:`baselines.training.trainer.Trainer`.

    A segment begins with new episodes, so that no state of an arm outlives it, and has the steps of whole ones.

    Args:
        config: Of the method.
        scenario: What is to be tracked.
        seed: Of the run.

    Raises:
        UnknownNameError: There is no such base policy.
        InvalidInputError: Numbers do not divide, or `init` does not suit.
        TrainingError: The file of `init` cannot be read.
    """

    def __init__(self, config: Reinforcement, scenario: Scenario, seed: int) -> None:
        self.processing, self.segments = config.processing, config.segments
        self._config, self._seed = config, seed
        # Of an action, in steps of the arm.
        self._hold = config.hold if config.output == "inverse" else 1
        self._length = config.episodes * scenario.steps // self._hold
        self._scenario = scenario
        self._episode_lengths = _episode_lengths(scenario.steps, config.initial_episode_steps)
        self._env = self._new_env(self._episode_lengths[0])
        self._ends = config.n_envs * config.episodes * scenario.steps // self._episode_lengths[0]
        self.model: Any = self._make()
        if config.init is not None:
            begin_from(self.model, config)
            self._begun()

    def score(self, episodes: int) -> Score:
        """See :meth:`baselines.training.trainer.Trainer.score`."""
        return score_of_model(self.model, self.processing, self._scenario, episodes)

    @property
    def steps(self) -> int:
        """Steps that arms have been moved by so far."""
        return int(self.model.num_timesteps) * self._hold

    def segment(self, number: int) -> SegmentMetrics:
        """Trains for one segment.

        Args:
            number: Counted from 0.
        """
        model = self.model
        lengths = self._episode_lengths
        if len(lengths) > 1:
            self._env = self._new_env(lengths[min(2 * len(lengths) * number // self.segments, len(lengths) - 1)])
            model.set_env(self._env)
        self._env.seed(episode_seed(self._seed, number, self._env.num_envs))
        model._last_obs = None  # makes it reset the environment
        model.ep_info_buffer = None
        model.lr_schedule = FloatSchedule(self._config.learning_rate_of(number))
        model.logger.name_to_value.clear()
        with self._actor_frozen() if number < self._config.critic_warmup else contextlib.nullcontext():
            self._learn()
        metrics = {name: float(value) for name, value in model.logger.name_to_value.items()}
        metrics["rollout/ep_rew_mean"] = float(np.mean([episode["r"] for episode in model.ep_info_buffer]))
        if self._config.output != "velocities":  # whose returns are no costs
            return metrics
        # Of the shorter ones of the curriculum, what a whole one would cost.
        costs = [-episode["r"] * self._scenario.steps / episode["l"] for episode in model.ep_info_buffer]
        metrics["train/cost"] = float(np.exp(np.mean(np.log(np.maximum(costs, np.finfo(np.float64).tiny)))))
        return metrics

    def state(self) -> dict[str, Any]:
        """See :meth:`baselines.training.trainer.Trainer.state`."""
        _, others = self.model._get_torch_save_params()
        return {
            "parameters": copy.deepcopy(self.model.get_parameters()),
            "others": {name: getattr(self.model, name).detach().clone() for name in others},
            "counters": {name: int(getattr(self.model, name)) for name in COUNTERS},
        }

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`baselines.training.trainer.Trainer.restore`."""
        self.model.set_parameters(state["parameters"], device="cpu")
        for name, tensor in state["others"].items():
            getattr(self.model, name).data.copy_(tensor)
        for name, count in state["counters"].items():
            setattr(self.model, name, count)

    def _new_env(self, episode_steps: int) -> VecEnv:
        config = self._config
        if config.output == "bilinear":
            return SpreadVecEnv(config.n_envs, self._scenario, config.learning)
        if config.output == "inverse":
            assert isinstance(self.processing, Bilinear)
            settings = config.hold, config.lost_distance, config.privileged, config.log_above
            return InverseVecEnv(config.n_envs, self._scenario, self.processing, *settings, **self._exploration)
        # Values are then of the size of rewards: of sums a hundred times as large, the critics would take most of the
        # gradient that is left after it has been clipped.
        scale = max(1.0 - config.gamma, 1e-3)
        return ProcessedVecEnv(config.n_envs, self._scenario, config.velocities, config.reward, scale, episode_steps)

    @property
    def _exploration(self) -> dict[str, Any]:
        """What else the environment is told whose actions weigh a damped inverse."""
        return {}

    @property
    def _seen(self) -> int | None:
        """How many of the numbers observed the actor sees; None for all."""
        if not isinstance(self._env, InverseVecEnv) or self._env.observation_space.shape == (self._env.seen,):
            return None
        return self._env.seen

    @property
    def _noise_scales(self) -> FloatArray:
        """Noise of each output, against that of most. Shape (number of outputs,)."""
        space = self._env.action_space
        assert isinstance(space, spaces.Box)
        scales = np.ones(space.shape)
        if self._config.output == "inverse":
            scales[: self._scenario.joints] = self._config.null_noise
        return scales

    def _learn(self) -> None:
        self.model.learn(self._segment_steps, self._callback(), log_interval=None, reset_num_timesteps=False)

    @property
    def _segment_steps(self) -> int:
        """Actions of a segment, those of all arms together."""
        return int(self._length * self._env.num_envs)

    def _callback(self) -> BaseCallback | None:
        """What Stable-Baselines3 calls while it learns."""
        return None

    @abc.abstractmethod
    def _make(self) -> BaseAlgorithm:
        """The untrained model."""

    def _begun(self) -> None:  # noqa: B027  # most have nothing to do then
        """Called when the model has got weights from elsewhere."""

    @abc.abstractmethod
    def _actor(self) -> list[nn.Parameter]:
        """The weights of the actor."""

    @contextlib.contextmanager
    def _actor_frozen(self) -> Iterator[None]:
        """Lets only the critics learn."""
        for parameter in self._actor():
            parameter.requires_grad_(False)
        try:
            yield
        finally:
            for parameter in self._actor():
                parameter.requires_grad_(True)

    def _divides(self, name: str, steps: int) -> int:
        """Insists that a number of steps divides those of a segment, so that the segment is not overrun."""
        if self._length % steps:
            raise InvalidInputError(
                f"{name}: expected a divisor of the {self._length} steps of a segment, got {steps}."
            )
        return steps


def _episode_lengths(steps: int, first: int | None) -> list[int]:
    """Lengths of episodes that a segment is a multiple of, from the first one up to the whole."""
    if first is None:
        return [steps]
    if steps % first:
        raise InvalidInputError(
            f"initial_episode_steps: expected a divisor of the {steps} steps of an episode, got {first}."
        )
    return [length for length in range(first, steps + 1) if steps % length == 0]
