"""PPO of Stable-Baselines3, whose critic may learn by itself."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from torch import nn

from baselines.training.config.ppo import PPO
from baselines.training.environment.inverse_env import InverseVecEnv
from baselines.training.trainer import SegmentMetrics
from baselines.training.trainers.models import new_model
from baselines.training.trainers.reinforcement import ReinforcementTrainer
from baselines.training.trainers.rollout_end import CriticEpochs, GroupBaseline
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray


class PPOTrainer(ReinforcementTrainer):
    """See :class:`baselines.training.config.reinforcement.PPO`."""

    _config: PPO

    def __init__(self, config: PPO, scenario: Scenario, seed: int) -> None:
        super().__init__(config, scenario, seed)
        policy = self.model.policy
        critic = [*policy.mlp_extractor.value_net.parameters(), *policy.value_net.parameters()]
        self._critic_optimizer = torch.optim.Adam(critic, config.critic_learning_rate)

    def state(self) -> dict[str, Any]:
        """See :meth:`baselines.training.trainer.Trainer.state`."""
        if not self._config.critic_epochs:
            return super().state()
        return {**super().state(), "critic": {"optimizer": copy.deepcopy(self._critic_optimizer.state_dict())}}

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`baselines.training.trainer.Trainer.restore`."""
        super().restore(state)
        if self._config.critic_epochs:
            self._critic_optimizer.load_state_dict(copy.deepcopy(state["critic"]["optimizer"]))

    def _make(self) -> BaseAlgorithm:
        config = self._config
        n_steps = self._divides("n_steps", self._length if config.n_steps is None else config.n_steps)
        if (n_steps * config.n_envs) % config.batch_size:
            raise InvalidInputError(
                f"batch_size: expected a divisor of the {n_steps * config.n_envs} transitions between two updates, got "
                f"{config.batch_size}."
            )
        model = new_model(
            "ppo",
            self._env,
            config.hidden,
            config.activation,
            config.log_std_init,
            config.use_sde,
            (config.output, config.damping),
            self._seen,
            self._env.freedom if config.null_space_noise and isinstance(self._env, InverseVecEnv) else None,
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
            vf_coef=0.0 if config.critic_epochs else 0.5,
            stats_window_size=self._ends,
        )
        self._set_log_std(model, config.log_std_init)
        return model

    def segment(self, number: int) -> SegmentMetrics:
        """See :meth:`baselines.training.trainer.Trainer.segment`."""
        given = self._config.log_std_of(number)
        if given is not None:
            self.model.policy.log_std.requires_grad_(False)
            self._set_log_std(self.model, given)
        return super().segment(number)

    def _callback(self) -> BaseCallback:
        config, callbacks = self._config, list[BaseCallback]()
        if config.group_size > 1:
            callbacks.append(GroupBaseline())
        if config.critic_epochs:
            settings = config.critic_epochs, config.batch_size, config.group_size, config.critic_group_weight
            callbacks.append(CriticEpochs(self._critic_optimizer, *settings))
        return CallbackList(callbacks)

    @property
    def _exploration(self) -> dict[str, Any]:
        return {"group_size": self._config.group_size, "null_map": self._config.null_space_noise}

    @property
    def _noise_scales(self) -> FloatArray:
        if not self._config.null_space_noise:
            return super()._noise_scales
        assert isinstance(self._env, InverseVecEnv)
        return np.append(np.full(self._env.freedom, self._config.null_noise), 1.0)

    def _begun(self) -> None:
        self._set_log_std(self.model, self._config.log_std_init)

    def _set_log_std(self, model: Any, log_std: float) -> None:
        """Gives all outputs the same noise, but for the null motion, see :attr:`PPO.null_noise`."""
        with torch.no_grad():
            model.policy.log_std.copy_(torch.from_numpy(log_std + np.log(self._noise_scales)))

    def _actor(self) -> list[nn.Parameter]:
        policy: Any = self.model.policy
        return [*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters(), policy.log_std]
