"""The filter of agents with memory in PyTorch, for gradients of its estimates with respect to network weights."""

from __future__ import annotations

import itertools
from typing import Protocol

import torch
from torch import Tensor, nn

from baselines.agents.recurrent import kernels
from baselines.agents.recurrent.network import GatedNetwork
from baselines.agents.recurrent.processing import Recurrent
from baselines.solvers.adaptive.kalman import CURVATURE
from baselines.training.memory.episodes import Measurements

#: Factor of the first weights of the last layer.
QUIET = 0.01


class Gated(nn.Module):
    """:class:`baselines.agents.recurrent.network.GatedNetwork` in PyTorch, with the same names of tensors.

    Args:
        sizes: Inputs, units of each layer, outputs.
    """

    def __init__(self, sizes: tuple[int, ...]) -> None:
        super().__init__()
        self.sizes = sizes
        self.layers = nn.ModuleList([nn.GRUCell(a, b) for a, b in itertools.pairwise(sizes[:-1])])
        self.head = nn.Linear(sizes[-2], sizes[-1])
        with torch.no_grad():
            self.head.weight.mul_(QUIET)
            self.head.bias.zero_()

    @property
    def dtype(self) -> torch.dtype:
        """Of its weights."""
        return self.head.weight.dtype

    def start(self, rows: int) -> list[Tensor]:
        """The states of the layers at the start of an episode."""
        return [torch.zeros(rows, units, dtype=self.dtype) for units in self.sizes[1:-1]]

    def forward(self, x: Tensor, hidden: list[Tensor]) -> tuple[Tensor, list[Tensor]]:
        """Outputs of shape (B, o), and the states after a step."""
        after = []
        for layer, state in zip(self.layers, hidden, strict=True):
            x = layer(x, state)
            after.append(x)
        return self.head(x), after

    def to_runtime(self) -> GatedNetwork:
        """The network for the compiled runtime."""
        tensors = {name: tensor.detach().numpy().copy() for name, tensor in self.state_dict().items()}
        return GatedNetwork(self.sizes, tensors)


def describe(surprise: Tensor, loaded: Tensor, spread: Tensor, steps: Tensor) -> Tensor:
    """:func:`baselines.agents.recurrent.kernels.describe` of B rows. Shape (B, 13)."""
    most, smallest = kernels.SHOWN_MOST, kernels.SMALLEST_SQUARE
    shown = most * torch.tanh(surprise / (spread + kernels.SHOWN_NOISE**2).sqrt() / most)
    along, length = ((x * loaded).reshape(-1, 2, 3).sum(2) for x in (surprise, loaded))
    expected = spread.reshape(-1, 2, 3).mean(2) + smallest + kernels.SHOWN_NOISE**2
    along = most * torch.tanh(along / ((length + smallest) * expected).sqrt() / most)
    squares = [(x.reshape(-1, 2, 3).mean(2) + smallest).log() for x in (surprise.square(), spread)]
    logs = [(x - kernels.MIDDLE) / kernels.SPAN for x in squares]
    return torch.cat([shown, along, *logs, steps.log()[:, None] / kernels.SPAN], 1)


def interpret(output: Tensor) -> tuple[Tensor, Tensor]:
    """Variances of the noises, of shape (B, 6), and of changes of the joint zeros, of shape (B, 2)."""
    scale = (kernels.MOST * torch.tanh(output.double() / kernels.MOST)).exp()
    noise = scale[:, :2] * torch.tensor([kernels.POSITION_NOISE, kernels.ROTATION_NOISE], dtype=torch.float64)
    changes = scale[:, 2:].square() * torch.tensor([kernels.CHANGE, kernels.PAYLOAD], dtype=torch.float64)
    return noise.square().repeat_interleave(3, 1), changes.square()


class Recurrence(Protocol):
    """A network that tunes the filter: a :class:`Gated`, perhaps with noise on its outputs."""

    @property
    def dtype(self) -> torch.dtype:
        """Of the features."""

    def start(self, rows: int) -> list[Tensor]:
        """See :class:`Gated`."""

    def __call__(self, x: Tensor, hidden: list[Tensor], /) -> tuple[Tensor, list[Tensor]]:
        """See :class:`Gated`."""


def errors(network: Recurrence, processing: Recurrent, measured: Measurements) -> tuple[Tensor, Tensor]:
    """Errors of the estimates at each measurement, before and after the update by it. Shapes (B, T, 6).

    Args:
        network: Tunes the filter.
        processing: The prior of the filter.
        measured: The episodes.
    """
    rows, events, _, p = measured.sensitivity.shape
    joints = (p - 3) // 6
    prior = torch.from_numpy(processing.prior(joints))
    parameters, covariance = torch.zeros(rows, p, dtype=torch.float64), torch.diag(prior.square()).expand(rows, p, p)
    exact = torch.full((rows, 6), processing.start**2, dtype=torch.float64)
    nothing, always = torch.zeros(rows, 2, dtype=torch.float64), torch.ones(rows, dtype=torch.bool)
    first = measured.sensitivity[:, 0], measured.true[:, 0]
    parameters, covariance = _updated(first, exact, nothing, always, parameters, covariance)
    hidden, waited = network.start(rows), torch.ones(rows, dtype=torch.float64)
    before, after = [], []
    for k in range(events):
        rate, arrived = measured.sensitivity[:, k], measured.arrived[:, k]
        surprise = measured.error[:, k] - _product(rate, parameters)
        spread = ((rate @ covariance) * rate).sum(2)
        loaded = rate[:, :, : (p - 3) // 6].sum(2)
        features = describe(surprise, loaded, spread, waited).to(network.dtype)
        output, fresh = network(features, hidden)
        hidden = [torch.where(arrived[:, None], new, old) for new, old in zip(fresh, hidden, strict=True)]
        before.append(measured.true[:, k] - _product(rate, parameters))
        noise, change = interpret(output)
        pair = rate, measured.error[:, k]
        parameters, covariance = _updated(pair, noise, change, arrived, parameters, covariance)
        after.append(measured.true[:, k] - _product(rate, parameters))
        waited = torch.where(arrived, 0.0, waited) + measured.steps
    return torch.stack(before, 1), torch.stack(after, 1)


def loss(network: Gated, processing: Recurrent, measured: Measurements, delta_x: float, floor: float) -> Tensor:
    """The mean logarithm of the costs of episodes: a constant part, and the costs of errors of the estimates.

    Args:
        network: The network that is trained.
        processing: The prior of the filter.
        measured: The episodes.
        delta_x: The error that costs 1 a step.
        floor: The cost of a step without error.
    """
    out: Tensor = (costs(network, processing, measured, delta_x).mean(1) + floor).log().mean()
    return out


def costs(network: Recurrence, processing: Recurrent, measured: Measurements, delta_x: float) -> Tensor:
    """Costs of errors of the estimates, from each measurement to the next. Shape (B, T - 1).

    Args:
        network: Tunes the filter.
        processing: The prior of the filter.
        measured: The episodes.
        delta_x: The error that costs 1 a step.
    """
    before, after = errors(network, processing, measured)
    # In between, the error lies between the two.
    return 0.5 * (after[:, :-1].square() + before[:, 1:].square()).sum(2) / delta_x**2


def _product(rate: Tensor, parameters: Tensor) -> Tensor:
    return (rate @ parameters[:, :, None])[:, :, 0]


def _updated(
    pair: tuple[Tensor, Tensor], noise: Tensor, change: Tensor, arrived: Tensor, parameters: Tensor, covariance: Tensor
) -> tuple[Tensor, Tensor]:
    """A step of the filter.

    Args:
        pair: Derivatives and error, of shapes (B, 6, p) and (B, 6).
        noise: Variances. Shape (B, 6).
        change: Variances of changes of joint zeros, each by itself, and all alike. Shape (B, 2).
        arrived: Rows with a measurement. Shape (B,).
        parameters: Shape (B, p).
        covariance: Shape (B, p, p).
    """
    rate, error = pair
    joints = (rate.shape[2] - 3) // 6
    moved = torch.zeros(2, *rate.shape[2:] * 2, dtype=torch.float64)
    moved[0, :joints, :joints], moved[1, :joints, :joints] = torch.eye(joints, dtype=torch.float64), 1.0
    wider = covariance + torch.einsum("bk,kij->bij", change, moved)
    reach = rate @ wider
    spread = reach @ rate.mT
    size = torch.diagonal(spread, dim1=1, dim2=2)
    total = spread + torch.diag_embed(noise + (CURVATURE * size).square())
    gain = torch.linalg.solve(total, reach) * arrived[:, None, None]
    missing = error - _product(rate, parameters)
    parameters = parameters + (gain.mT @ missing[:, :, None])[:, :, 0]
    return parameters, torch.where(arrived[:, None, None], wider - gain.mT @ reach, covariance)
