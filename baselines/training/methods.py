"""All methods of training by name, and the interface of their trainers."""

from __future__ import annotations

import abc
import importlib
from typing import TYPE_CHECKING, Any

from baselines.training.config.apg import APG
from baselines.training.config.base import Config
from baselines.training.config.observe import Observe
from baselines.training.config.reinforcement import PPO, SAC, TD3
from ikgym.exceptions import UnknownNameError
from ikgym.scenarios import Scenario

if TYPE_CHECKING:  # the command line is read without PyTorch
    from torch import nn

    from baselines.agents.files import AgentFile

#: Metrics of a segment by name.
SegmentMetrics = dict[str, float]

#: Configurations by the names of their methods; the docstring of each describes the method on the command line.
METHODS: dict[str, type[Config]] = {kind.method: kind for kind in (PPO, SAC, TD3, APG, Observe)}
#: Trainers by the names of their methods: modules and classes, called with configuration, scenario and seed.
_TRAINERS = {
    "ppo": ("baselines.training.trainers.sb3", "SB3Trainer"),
    "sac": ("baselines.training.trainers.sb3", "SB3Trainer"),
    "td3": ("baselines.training.trainers.sb3", "SB3Trainer"),
    "apg": ("baselines.training.trainers.apg", "APGTrainer"),
    "observe": ("baselines.training.trainers.observe", "ObserveTrainer"),
}


class Trainer(abc.ABC):
    """A training that proceeds segment by segment.

    Before it is constructed and before each segment, :func:`baselines.training.randomness.reseed` seeds the generators
    of Python, NumPy and PyTorch; all other randomness comes from :func:`baselines.training.randomness.sequence`. A
    segment depends on nothing but :meth:`state` and its number: a run that was killed and resumed from any earlier
    state ends with the same weights, bit for bit.

    Attributes:
        policy: The module whose weights are evaluated and kept.
        steps: Steps of the environment so far, those of all arms together.
    """

    policy: nn.Module
    steps: int

    @abc.abstractmethod
    def segment(self, number: int) -> SegmentMetrics:
        """Trains for one segment.

        Args:
            number: Counted from 0.
        """

    @abc.abstractmethod
    def agent(self, training: dict[str, Any] | None = None) -> AgentFile:
        """The agent with the present weights of `policy`.

        Args:
            training: How it was trained, as JSON values.
        """

    @abc.abstractmethod
    def state(self) -> dict[str, Any]:
        """All that later segments depend on: tensors, numbers, texts, and lists and dicts of them."""

    @abc.abstractmethod
    def restore(self, state: dict[str, Any]) -> None:
        """Continues from a state.

        Args:
            state: As :meth:`state` returned it, in this process or another.
        """


def get(name: str) -> type[Config]:
    """The configuration of a method.

    Raises:
        UnknownNameError: There is no such method; the message has the nearest name.
    """
    if name not in METHODS:
        raise UnknownNameError("method", name, METHODS)
    return METHODS[name]


def new_trainer(config: Config, scenario: Scenario, seed: int) -> Trainer:
    """The trainer of a configuration.

    Args:
        config: Of any method.
        scenario: The scenario to train on.
        seed: Of the run.
    """
    module, name = _TRAINERS[config.method]
    kind: Any = getattr(importlib.import_module(module), name)
    trainer: Trainer = kind(config, scenario, seed)
    return trainer
