"""What PPO does with a rollout before its actor learns from it."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback
from torch import Tensor

from baselines.training.config.ppo import PPO


class RolloutEnd(BaseCallback):
    """Compares arms that play the same episodes, and fits the critic.

    Advantages lose what they have in common with those of the same group, and the critic is fitted to what the
    transitions returned, group by group.

    Args:
        config: Of the run.
        optimizer: Of the critic's weights.
    """

    def __init__(self, config: PPO, optimizer: torch.optim.Optimizer) -> None:
        super().__init__()
        self._config, self._optimizer = config, optimizer

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        model: Any = self.model
        size, buffer = self._config.group_size, model.rollout_buffer
        if size > 1:
            buffer.advantages = beside_the_others(buffer.advantages, size)
        for _ in range(self._config.critic_epochs):
            self._fit(model.policy, buffer.observations, torch.from_numpy(buffer.returns))

    def _fit(self, policy: Any, observations: NDArray[np.float32], returns: Tensor) -> None:
        """One pass over the transitions of a rollout, whose groups stay together.

        Args:
            policy: Whose critic it is.
            observations: Shape (T, N, …).
            returns: Shape (T, N).
        """
        size, weight = self._config.group_size, self._config.critic_group_weight
        groups = torch.arange(returns.numel()).reshape(-1, size)
        seen, returned = torch.from_numpy(observations).flatten(0, 1), returns.flatten()
        for batch in torch.tensor_split(torch.randperm(len(groups)), len(returned) // self._config.batch_size):
            rows = groups[batch].flatten()
            errors = (policy.predict_values(seen[rows]).flatten() - returned[rows]).reshape(-1, size)
            loss: Any = errors.square().mean() + weight * (errors - errors.mean(1, keepdim=True)).square().mean()
            self._optimizer.zero_grad()
            loss.backward()
            self._optimizer.step()


def beside_the_others(advantages: NDArray[np.float32], group_size: int) -> NDArray[np.float32]:
    """Advantages, each less the mean of those of the other arms of its group at the same time.

    Args:
        advantages: Shape (T, N), the arms of a group one after the other.
        group_size: At least 2.
    """
    groups = advantages.reshape(len(advantages), -1, group_size)
    beside = (groups - groups.mean(axis=2, keepdims=True)) * (group_size / (group_size - 1))
    out: NDArray[np.float32] = beside.reshape(advantages.shape).astype(np.float32)
    return out
