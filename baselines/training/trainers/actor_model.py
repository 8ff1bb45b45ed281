"""An actor and nothing else, where a method needs no critic: a network in PyTorch whose outputs are not squashed."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import torch
from torch import nn

from baselines.training.config.base import Activation
from baselines.training.trainers.layers import ACTIVATIONS, QUIET


@dataclasses.dataclass(eq=False)
class ActorModel:
    """What stands where other methods have a model of Stable-Baselines3.

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
