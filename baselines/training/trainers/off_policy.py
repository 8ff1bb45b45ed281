"""SAC and TD3 of Stable-Baselines3."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.noise import ActionNoise, NormalActionNoise, OrnsteinUhlenbeckActionNoise
from torch import nn

from baselines.training.config.off_policy import SAC, TD3, OffPolicy
from baselines.training.trainers.models import new_model
from baselines.training.trainers.reinforcement import ReinforcementTrainer
from ikgym.validation import FloatArray

#: What a replay buffer holds, a row a step.
REPLAYED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
#: Entropy that SAC aims at, of each number of an action, in [nat]: −1, the usual choice, is too much noise here.
TARGET_ENTROPY = -3.0


class _LearningStarts(BaseCallback):
    """Keeps a model from learning in its first steps.

    With its own `learning_starts`, Stable-Baselines3 would act at random until then, and lose the arm.

    Args:
        learning_starts: Steps, those of all arms together.
        gradient_steps: Of an update after them.
    """

    def __init__(self, learning_starts: int, gradient_steps: int) -> None:
        super().__init__()
        self._learning_starts, self._gradient_steps = learning_starts, gradient_steps

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        model: Any = self.model
        model.gradient_steps = self._gradient_steps if model.num_timesteps > self._learning_starts else 0


class OffPolicyTrainer(ReinforcementTrainer):
    """What SAC and TD3 have in common: a replay buffer, which is part of the state."""

    _config: OffPolicy

    def state(self) -> dict[str, Any]:
        """See :meth:`baselines.training.trainer.Trainer.state`."""
        buffer = self.model.replay_buffer
        rows = slice(buffer.size())
        replayed = {name: torch.tensor(getattr(buffer, name)[rows]) for name in REPLAYED}
        return {**super().state(), "buffer": {"pos": buffer.pos, "full": buffer.full, **replayed}}

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`baselines.training.trainer.Trainer.restore`."""
        super().restore(state)
        buffer, kept = self.model.replay_buffer, state["buffer"]
        for name in REPLAYED:
            getattr(buffer, name)[: len(kept[name])] = kept[name].numpy()
        buffer.pos, buffer.full = kept["pos"], kept["full"]

    def _callback(self) -> BaseCallback:
        given = self._config.learning_starts
        return _LearningStarts(self._segment_steps if given is None else given, self._config.gradient_steps)

    def _parameters(self) -> dict[str, Any]:
        config = self._config
        return {
            "learning_rate": config.learning_rate,
            "buffer_size": config.buffer_size,
            "learning_starts": 0,  # see _LearningStarts
            "batch_size": config.batch_size,
            "tau": config.tau,
            "gamma": config.gamma,
            "train_freq": (self._divides("train_freq", config.train_freq), "step"),
            "gradient_steps": config.gradient_steps,
            "stats_window_size": self._ends,
        }

    def _actor(self) -> list[nn.Parameter]:
        return list(self.model.policy.actor.parameters())


class SACTrainer(OffPolicyTrainer):
    """See :class:`baselines.training.config.reinforcement.SAC`."""

    _config: SAC

    def _make(self) -> BaseAlgorithm:
        config, scales = self._config, self._noise_scales
        model: Any = new_model(
            "sac",
            self._env,
            config.hidden,
            config.activation,
            config.log_std_init,
            config.use_sde,
            (config.output, config.damping),
            self._seen,
            sde_sample_freq=config.sde_sample_freq,
            ent_coef=config.ent_coef,
            target_entropy=TARGET_ENTROPY * len(scales) if config.target_entropy is None else config.target_entropy,
            **self._parameters(),
        )
        if config.null_noise != 1.0:
            log_std = model.policy.actor.log_std
            with torch.no_grad():
                (log_std if config.use_sde else log_std.bias).add_(torch.from_numpy(np.log(scales)))
        made: BaseAlgorithm = model
        return made

    @contextlib.contextmanager
    def _actor_frozen(self) -> Iterator[None]:
        """The weight of the entropy stays, too: it would diverge while the actor cannot follow."""
        model: Any = self.model
        if model.ent_coef_optimizer is None:
            with super()._actor_frozen():
                yield
            return
        optimizer, model.ent_coef_optimizer = model.ent_coef_optimizer, None
        model.ent_coef_tensor = model.log_ent_coef.detach().exp()
        try:
            with super()._actor_frozen():
                yield
        finally:
            model.ent_coef_optimizer = optimizer
            del model.ent_coef_tensor


class TD3Trainer(OffPolicyTrainer):
    """See :class:`baselines.training.config.reinforcement.TD3`."""

    _config: TD3

    def _make(self) -> BaseAlgorithm:
        config = self._config
        return new_model(
            "td3",
            self._env,
            config.hidden,
            config.activation,
            output=(config.output, config.damping),
            seen=self._seen,
            action_noise=_noise(config.action_noise * self._noise_scales, config.action_noise_correlation),
            policy_delay=config.policy_delay,
            target_policy_noise=config.target_policy_noise,
            target_noise_clip=2.5 * config.target_policy_noise,
            **self._parameters(),
        )


def _noise(deviations: FloatArray, steps: int) -> ActionNoise:
    """Noise of standard deviations, with a correlation time in steps."""
    mean = np.zeros(len(deviations))
    if steps == 1:
        return NormalActionNoise(mean, deviations)
    return OrnsteinUhlenbeckActionNoise(mean, deviations * np.sqrt(2.0 / steps), theta=1.0 / steps, dt=1.0)
