"""Networks in PyTorch."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import torch
from torch import nn

from baselines.agents.network import Network
from baselines.training.config.base import Activation

ACTIVATIONS: dict[Activation, type[nn.Module]] = {"silu": nn.SiLU, "relu": nn.ReLU, "tanh": nn.Tanh, "elu": nn.ELU}

#: The first weights of the last layer are made this much smaller.
QUIET = 0.01


def new_actor(sizes: Sequence[int], activation: Activation) -> nn.Sequential:
    """Linear layers with activations in between, whose first outputs are almost 0.

    The first weights are drawn from the global generator of PyTorch.

    Args:
        sizes: Inputs, neurons of the hidden layers, outputs.
        activation: Of the hidden layers.
    """
    layers = [nn.Linear(inputs, outputs) for inputs, outputs in itertools.pairwise(sizes)]
    with torch.no_grad():
        layers[-1].weight.mul_(QUIET)
        layers[-1].bias.zero_()
    hidden = [module for layer in layers[:-1] for module in (layer, ACTIVATIONS[activation]())]
    return nn.Sequential(*hidden, layers[-1])


def runtime(modules: Sequence[nn.Module], squash: str) -> Network:
    """Linear layers with activations in between, for the compiled runtime.

    Args:
        modules: Linear layers and activations in turn.
        squash: See :class:`Network`.

    Raises:
        TypeError: There is another module, or activations of several kinds.
    """
    linear, between = modules[::2], modules[1::2]
    names = [name for name, kind in ACTIVATIONS.items() if all(type(module) is kind for module in between)]
    if not names or not all(isinstance(layer, nn.Linear) for layer in linear) or len(linear) != len(between) + 1:
        raise TypeError(f"expected linear layers with one of {', '.join(ACTIVATIONS)} between them, got {modules}")
    weights, biases = ([getattr(layer, part).detach().cpu().numpy() for layer in linear] for part in ("weight", "bias"))
    return Network(tuple(weights), tuple(biases), names[0], squash)
