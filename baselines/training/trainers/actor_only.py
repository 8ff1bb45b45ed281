"""What methods have in common that train an actor without rewards and critics."""

from __future__ import annotations

import abc
import copy
from typing import Any

import torch
from torch import Tensor, nn

from baselines.training.config.actor_only import ActorOnly
from baselines.training.score import Score
from baselines.training.trainer import SegmentMetrics
from baselines.training.trainers.models import score_of_model
from ikgym.scenarios import Scenario


class ActorTrainer(abc.ABC):
    """Trains an actor by Adam, see :class:`baselines.training.trainer.Trainer`.

    Args:
        config: Of the method.
        scenario: What is to be tracked.
        seed: Of the run.
        model: What is evaluated and kept.
        actor: What is trained.
    """

    def __init__(self, config: ActorOnly, scenario: Scenario, seed: int, model: Any, actor: nn.Module) -> None:
        self.processing, self.segments = config.processing, config.segments
        self._config, self._scenario, self._seed = config, scenario, seed
        self.model, self._actor = model, actor
        self._adam = torch.optim.Adam(actor.parameters(), lr=config.learning_rate)

    @property
    def steps(self) -> int:
        """Steps of the environment so far, those of all arms together."""
        return int(self.model.num_timesteps)

    def score(self, episodes: int) -> Score:
        """See :meth:`baselines.training.trainer.Trainer.score`."""
        processing: Any = self.processing
        return score_of_model(self.model, processing, self._scenario, episodes)

    @abc.abstractmethod
    def segment(self, number: int) -> SegmentMetrics:
        """See :meth:`baselines.training.trainer.Trainer.segment`."""

    def state(self) -> dict[str, Any]:
        """See :meth:`baselines.training.trainer.Trainer.state`."""
        return {
            "policy": copy.deepcopy(self.model.policy.state_dict()),
            "adam": copy.deepcopy(self._adam.state_dict()),
            "steps": self.steps,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`baselines.training.trainer.Trainer.restore`."""
        self.model.policy.load_state_dict(state["policy"])
        self._adam.load_state_dict(copy.deepcopy(state["adam"]))
        self.model.num_timesteps = state["steps"]

    def _descend(self, loss: Tensor) -> bool:
        """One step of Adam; False where the gradient is not finite, and nothing was done."""
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
