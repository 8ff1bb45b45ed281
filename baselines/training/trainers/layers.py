"""What all networks in training have in common."""

from __future__ import annotations

from torch import nn

from baselines.training.config.base import Activation

ACTIVATIONS: dict[Activation, type[nn.Module]] = {
    "silu": nn.SiLU,
    "relu": nn.ReLU,
    "tanh": nn.Tanh,
    "elu": nn.ELU,
}

#: The last layer's first weights are made this much smaller: an agent begins near its base policy, or near rest.
QUIET = 0.01
