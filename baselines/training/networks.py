"""Networks in PyTorch: what all have in common, and an actor that stands alone."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import torch
from torch import nn

from baselines.training.config.base import Activation
from baselines.training.memory.filter import Gated

ACTIVATIONS: dict[Activation, type[nn.Module]] = {
    "silu": nn.SiLU,
    "relu": nn.ReLU,
    "tanh": nn.Tanh,
    "elu": nn.ELU,
}

#: The last layer's first weights are made this much smaller: an agent begins near its base policy, or near rest.
QUIET = 0.01


@dataclasses.dataclass(eq=False)
class ActorModel:
    """An actor and nothing else, whose outputs are not squashed.

    Where a method needs no critic, it stands where others have a model of Stable-Baselines3.

    Args:
        policy: Linear layers with activations in between, the last one without.
        num_timesteps: Steps of the environment that it was trained in.
    """

    policy: nn.Sequential
    num_timesteps: int = 0

    @classmethod
    def new(cls, sizes: Sequence[int], activation: Activation) -> ActorModel:
        """An untrained one, whose first outputs are almost 0.

        Its first weights are drawn from the generator of PyTorch that all share.

        Args:
            sizes: Inputs, neurons of the hidden layers, outputs.
            activation: Of the hidden layers.
        """
        layers = [nn.Linear(inputs, outputs) for inputs, outputs in itertools.pairwise(sizes)]
        with torch.no_grad():
            layers[-1].weight.mul_(QUIET)
            layers[-1].bias.zero_()
        hidden = [module for layer in layers[:-1] for module in (layer, ACTIVATIONS[activation]())]
        return cls(nn.Sequential(*hidden, layers[-1]))


@dataclasses.dataclass(eq=False)
class MemoryModel:
    """An actor with memory, which tunes a filter.

    Args:
        policy: Its network.
        num_timesteps: Steps of the environment that it was trained in.
    """

    policy: Gated
    num_timesteps: int = 0
