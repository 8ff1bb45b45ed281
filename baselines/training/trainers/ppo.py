"""PPO of Stable-Baselines3."""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from torch import nn

from baselines.training.config.reinforcement import PPO
from baselines.training.trainer import SegmentMetrics
from baselines.training.trainers.models import new_model
from baselines.training.trainers.reinforcement import ReinforcementTrainer
from ikgym.exceptions import InvalidInputError


class PPOTrainer(ReinforcementTrainer):
    """See :class:`baselines.training.config.reinforcement.PPO`."""

    _config: PPO

    def _make(self) -> BaseAlgorithm:
        config = self._config
        n_steps = self._divides("n_steps", self._length if config.n_steps is None else config.n_steps)
        if (n_steps * config.n_envs) % config.batch_size:
            raise InvalidInputError(
                f"batch_size: expected a divisor of the {n_steps * config.n_envs} transitions between two updates, got "
                f"{config.batch_size}."
            )
        return new_model(
            "ppo",
            self._env,
            config.hidden,
            config.activation,
            config.log_std_init,
            config.use_sde,
            (config.output, config.damping),
            sde_sample_freq=config.sde_sample_freq,
            learning_rate=config.learning_rate,
            n_steps=n_steps,
            batch_size=config.batch_size,
            n_epochs=config.n_epochs,
            gamma=config.gamma,
            gae_lambda=config.gae_lambda,
            clip_range=config.clip_range,
            target_kl=config.target_kl,
            ent_coef=config.ent_coef,
            stats_window_size=self._ends,
        )

    def segment(self, number: int) -> SegmentMetrics:
        """See :meth:`baselines.training.trainer.Trainer.segment`."""
        given = self._config.log_std_of(number)
        if given is not None:
            self.model.policy.log_std.requires_grad_(False).fill_(given)
        return super().segment(number)

    def _begun(self) -> None:
        with torch.no_grad():
            self.model.policy.log_std.fill_(self._config.log_std_init)

    def _actor(self) -> list[nn.Parameter]:
        policy: Any = self.model.policy
        return [*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters(), policy.log_std]
