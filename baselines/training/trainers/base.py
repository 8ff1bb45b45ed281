"""The interface of trainers, and the base of those that train a network without a critic."""

from __future__ import annotations

import abc
import copy
from typing import Any

import torch
from torch import Tensor, nn

from baselines.agents.files import AgentFile
from baselines.training.config import ActorOnly
from ikgym.scenarios import Scenario

#: Metrics of a segment by name.
SegmentMetrics = dict[str, float]


class Trainer(abc.ABC):
    """A training that proceeds segment by segment.

    Before it is constructed and before each segment, :func:`baselines.training.randomness.reseed` seeds the generators
    of Python, NumPy and PyTorch; all other randomness comes from :func:`baselines.training.randomness.sequence`. A
    segment depends on nothing but :meth:`state` and its number: a run that was killed and resumed from any earlier
    state ends with the same weights, bit for bit.

    Attributes:
        policy: The module whose weights are evaluated and kept.
        steps: Steps of the environment so far, summed over all arms.
    """

    policy: nn.Module
    steps: int

    @abc.abstractmethod
    def segment(self, number: int) -> SegmentMetrics:
        """Trains for one segment, counted from 0."""

    @abc.abstractmethod
    def agent(self, training: dict[str, Any] | None = None) -> AgentFile:
        """The agent with the present weights of `policy`; `training` says how it was trained, as JSON values."""

    @abc.abstractmethod
    def state(self) -> dict[str, Any]:
        """All that later segments depend on: tensors, numbers, strings, and lists and dicts of them."""

    @abc.abstractmethod
    def restore(self, state: dict[str, Any]) -> None:
        """Continues from a :meth:`state` of this process or another."""


class ActorTrainer(Trainer, abc.ABC):
    """Trains a network by Adam.

    Args:
        config: The options of the method.
        scenario: The scenario to train on.
        seed: The seed of the run.
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
        """One step of Adam; False, and no step, if the gradient is not finite."""
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
