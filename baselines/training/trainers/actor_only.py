"""Base of the trainers of networks without a critic."""

from __future__ import annotations

import abc
import copy
from typing import Any

import torch
from torch import Tensor, nn

from baselines.training.config.base import ActorOnly
from baselines.training.methods import Trainer
from ikgym.scenarios import Scenario


class ActorTrainer(Trainer, abc.ABC):
    """Trains a network by Adam.

    Args:
        config: Of the method.
        scenario: The scenario to train on.
        seed: Of the run.
        policy: The network that is evaluated and kept.
        actor: The network that is trained.
    """

    def __init__(self, config: ActorOnly, scenario: Scenario, seed: int, policy: nn.Module, actor: nn.Module) -> None:
        self._config, self._scenario, self._seed = config, scenario, seed
        self.policy, self._actor, self.steps = policy, actor, 0
        self._adam = torch.optim.Adam(actor.parameters(), lr=config.learning_rate)

    def state(self) -> dict[str, Any]:
        """See :meth:`Trainer.state`."""
        return {
            "policy": copy.deepcopy(self.policy.state_dict()),
            "adam": copy.deepcopy(self._adam.state_dict()),
            "steps": self.steps,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`Trainer.restore`."""
        self.policy.load_state_dict(state["policy"])
        self._adam.load_state_dict(copy.deepcopy(state["adam"]))
        self.steps = state["steps"]

    def _descend(self, loss: Tensor) -> bool:
        """One step of Adam; False, and no step, where the gradient is not finite."""
        self._adam.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        size = nn.utils.clip_grad_norm_(self._actor.parameters(), self._config.max_grad_norm)
        finite = bool(torch.isfinite(size))
        if finite:
            self._adam.step()
        return finite

    def _set_learning_rate(self, number: int) -> None:
        for group in self._adam.param_groups:
            group["lr"] = self._config.learning_rate_of(number)
