"""Agents with memory: gradients of a filter's estimates over an episode with respect to the network that tunes it."""

import math
from typing import Any

import numpy as np
import torch

from baselines.agents.files import AgentFile, agent_of
from baselines.training.config import Observe
from baselines.training.memory.episodes import Measurements, draw_plant, joined, measure, taken
from baselines.training.memory.filter import Gated, loss
from baselines.training.memory.rewards import explored, surrogate
from baselines.training.randomness import episode_seed, sequence
from baselines.training.trainers.base import ActorTrainer, SegmentMetrics
from ikgym.exceptions import InvalidInputError
from ikgym.kernels import tasks as task_kernels
from ikgym.scenarios import Scenario


class ObserveTrainer(ActorTrainer):
    """See :class:`Observe`.

    Args:
        config: The options of the method.
        scenario: The scenario with the arm and the paths.
        seed: The seed of the run.

    Raises:
        InvalidInputError: The task coordinates are not whole poses.
    """

    _config: Observe
    policy: Gated

    def __init__(self, config: Observe, scenario: Scenario, seed: int) -> None:
        if scenario.task.kind != task_kernels.POSE:
            raise InvalidInputError(
                f"task: expected pose, with errors of position and rotation, got {scenario.task.name!r}."
            )
        network = Gated(config.processing.sizes(config.hidden))
        super().__init__(config, scenario, seed, network, network)

    def segment(self, number: int) -> SegmentMetrics:
        """See :meth:`Trainer.segment`."""
        config, processing = self._config, self._config.processing
        self._set_learning_rate(number)
        measured, losses = self._measure(number), []
        for _ in range(config.gradient_steps):
            some = taken(measured, torch.randperm(config.n_envs)[: config.batch_size])
            about = self.policy, processing, some, self._scenario.cost.delta_x, config.step_cost
            if config.estimator == "ppo":
                self._learn_from_costs(about, math.exp(config.log_std_of(number)))
                with torch.no_grad():
                    value = loss(*about)
            else:
                value = loss(*about)
                self._descend(value)
            losses.append(value.item())
        return {"train/loss": float(np.mean(losses))}

    def _learn_from_costs(self, about: Any, std: float) -> None:
        """Gradient steps of PPO on some episodes.

        Args:
            about: The positional arguments of :func:`explored`.
            std: Standard deviation of the noise on outputs.
        """
        config = self._config
        rollout = explored(*about, std=std, group_size=config.group_size, gamma=config.gamma)
        for _ in range(config.n_epochs):
            self._descend(surrogate(self.policy, rollout, std, config.clip_range))

    def agent(self, training: dict[str, Any] | None = None) -> AgentFile:
        """See :meth:`Trainer.agent`."""
        return agent_of(self.policy.to_runtime(), self._config.processing, self._scenario, training)

    def _measure(self, number: int) -> Measurements:
        """Measurements of random plants and episodes."""
        config, scenario = self._config, self._scenario
        generator = np.random.default_rng(sequence(self._seed, number))
        first, each = episode_seed(self._seed, number, config.n_envs), config.n_envs // config.plants
        parts = []
        for k in range(config.plants):
            plant = draw_plant(generator, config.processing, config.measurements, scenario.steps)
            seeds = range(first + k * each, first + (k + 1) * each)
            parts.append(measure(scenario.replace(plant=plant), seeds, config.measurements))
            self.steps += each * min(config.measurements * plant.pose_every, scenario.steps)
        return joined(parts, max(part.error.shape[1] for part in parts))
