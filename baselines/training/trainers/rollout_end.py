"""What PPO does with a rollout before its actor learns from it."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback
from torch import Tensor

from baselines.training.groups import beside_the_others
from ikgym.exceptions import InvalidInputError


class GroupBaseline(BaseCallback):
    """Compares arms that play the same episodes.

    From the advantage of each arm of a rollout the mean of those of the other arms of its group is taken, so that the
    actor learns from what is due to its actions (leave-one-out baseline, Kool et al. 2019).

    >>> envs = InverseVecEnv(64, "panda-random", group_size=8)
    >>> model = PPO("MlpPolicy", envs).learn(100_000, callback=GroupBaseline())

    Raises:
        InvalidInputError: When the training begins: the environment has no attribute `group_size`, or one below 2.
    """

    def _init_callback(self) -> None:
        try:
            self._group_size = self.training_env.get_attr("group_size")[0]
        except AttributeError:
            self._group_size = 1
        if self._group_size < 2:
            raise InvalidInputError(
                "GroupBaseline: expected an environment in which arms play the same episodes, as InverseVecEnv with a "
                f"group_size of at least 2, got {type(self.training_env.unwrapped).__name__} without."
            )

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        model: Any = self.model
        model.rollout_buffer.advantages = beside_the_others(model.rollout_buffer.advantages, self._group_size)


class CriticEpochs(BaseCallback):
    """Fits the critic of PPO to what the transitions of a rollout returned, before the actor learns from them.

    Args:
        optimizer: Of the critic's weights.
        epochs: Passes over the transitions.
        batch_size: Transitions of a gradient step.
        group_size: Arms that play the same episodes.
        group_weight: Weight of the differences within groups in the loss.
    """

    model: Any

    def __init__(
        self, optimizer: torch.optim.Optimizer, epochs: int, batch_size: int, group_size: int, group_weight: float
    ) -> None:
        super().__init__()
        self._optimizer, self._epochs, self._batch_size = optimizer, epochs, batch_size
        self._group_size, self._group_weight = group_size, group_weight

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        buffer = self.model.rollout_buffer
        for _ in range(self._epochs):
            self.fit(buffer.observations, torch.from_numpy(buffer.returns))

    def fit(self, observations: NDArray[np.float32], returns: Tensor) -> None:
        """One pass over the transitions of a rollout, whose groups stay together.

        Args:
            observations: Shape (T, N, …).
            returns: Shape (T, N).
        """
        size, weight = self._group_size, self._group_weight
        groups = torch.arange(returns.numel()).reshape(-1, size)
        seen, returned = torch.from_numpy(observations).flatten(0, 1), returns.flatten()
        for batch in torch.tensor_split(torch.randperm(len(groups)), len(returned) // self._batch_size):
            rows = groups[batch].flatten()
            errors = (self.model.policy.predict_values(seen[rows]).flatten() - returned[rows]).reshape(-1, size)
            loss: Any = errors.square().mean() + weight * (errors - errors.mean(1, keepdim=True)).square().mean()
            self._optimizer.zero_grad()
            loss.backward()
            self._optimizer.step()
