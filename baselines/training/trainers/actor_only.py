"""What methods have in common that train an actor without rewards and critics."""

from __future__ import annotations

import abc
import copy
from typing import Any

import torch
from torch import Tensor, nn

from baselines.training.config.actor_only import ActorOnly
from baselines.training.environment.vec_env import ProcessedVecEnv
from baselines.training.trainer import SegmentMetrics
from baselines.training.trainers.initial_weights import begin_from
from baselines.training.trainers.models import mean_network, new_model, squash_of
from ikgym.scenarios import Scenario


class ActorTrainer(abc.ABC):
    """Trains the actor of a model of Stable-Baselines3 by Adam, see :class:`baselines.training.trainer.Trainer`.

    Args:
        config: Of the method.
        scenario: What is to be tracked.
        seed: Of the run.

    Raises:
        UnknownNameError: There is no such base policy.
        InvalidInputError: `init` does not suit.
    """

    def __init__(self, config: ActorOnly, scenario: Scenario, seed: int) -> None:
        self.processing, self.segments = config.processing, config.segments
        self._config, self._scenario, self._seed = config, scenario, seed
        env = ProcessedVecEnv(1, scenario, config.processing)
        self.model: Any = new_model(config.algorithm, env, config.hidden, config.activation)
        if config.init is not None:
            begin_from(self.model, config)
        self._actor = mean_network(self.model)
        self._squashed = squash_of(config.algorithm)
        self._adam = torch.optim.Adam(self._actor.parameters(), lr=config.learning_rate)

    @property
    def steps(self) -> int:
        """Steps of the environment so far, those of all arms together."""
        return int(self.model.num_timesteps)

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

    def _outputs(self, features: Tensor) -> Tensor:
        """The actor's outputs, with gradients. Shapes (N, f) and (N, n), float32."""
        mean: Tensor = self._actor(features)
        return mean.tanh() if self._squashed == "tanh" else mean

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

    def _finished(self) -> None:
        """Lets all that copies the actor follow it."""
        target = getattr(self.model.policy, "actor_target", None)
        if target is not None:
            target.load_state_dict(self.model.policy.actor.state_dict())
