"""The filter of agents with memory in PyTorch, for gradients from its estimates to the weights of its network."""

from __future__ import annotations

import itertools
from typing import Protocol

import torch
from torch import Tensor, nn

from baselines.agents.recurrent import kernels
from baselines.agents.recurrent.network import GatedNetwork
from baselines.agents.recurrent.processing import Recurrent
from baselines.solvers.adaptive.calibrated import CURVATURE
from baselines.training.memory.episodes import Measurements

#: The last layer's first weights are made this much smaller.
QUIET = 0.01


class Gated(nn.Module):
    """What :class:`baselines.agents.recurrent.network.GatedNetwork` is in PyTorch, with the same names.

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
        """The states of the layers when nothing has been seen."""
        return [torch.zeros(rows, units, dtype=self.dtype) for units in self.sizes[1:-1]]

    def forward(self, x: Tensor, hidden: list[Tensor]) -> tuple[Tensor, list[Tensor]]:
        """Outputs of shape (B, o), and the states after a step."""
        after = []
        for layer, state in zip(self.layers, hidden, strict=True):
            x = layer(x, state)
            after.append(x)
        return self.head(x), after

    def to_runtime(self) -> GatedNetwork:
        """The same for the compiled runtime."""
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


def believe(output: Tensor) -> tuple[Tensor, Tensor]:
    """Variances of the noises, of shape (B, 6), and of changes of the joint zeros, of shape (B, 2)."""
    scale = (kernels.MOST * torch.tanh(output.double() / kernels.MOST)).exp()
    noise = scale[:, :2] * torch.tensor([kernels.POSITION_NOISE, kernels.ROTATION_NOISE], dtype=torch.float64)
    changes = scale[:, 2:].square() * torch.tensor([kernels.CHANGE, kernels.PAYLOAD], dtype=torch.float64)
    return noise.square().repeat_interleave(3, 1), changes.square()


class Speaker(Protocol):
    """What is asked what measurements are worth: a :class:`Gated`, or what stands around one."""

    @property
    def dtype(self) -> torch.dtype:
        """Of what it is shown."""

    def start(self, rows: int) -> list[Tensor]:
        """See :class:`Gated`."""

    def __call__(self, x: Tensor, hidden: list[Tensor], /) -> tuple[Tensor, list[Tensor]]:
        """See :class:`Gated`."""


def errors(network: Speaker, processing: Recurrent, measured: Measurements) -> tuple[Tensor, Tensor]:
    """How far estimates are off at each measurement, before and after it was taken in. Shapes (B, T, 6).

    Args:
        network: Says what measurements are worth.
        processing: What the filter begins with.
        measured: The episodes.
    """
    rows, events, _, p = measured.sensitivity.shape
    joints = (p - 3) // 6
    prior = torch.from_numpy(processing.prior(joints))
    parameters, covariance = torch.zeros(rows, p, dtype=torch.float64), torch.diag(prior.square()).expand(rows, p, p)
    exact = torch.full((rows, 6), processing.start**2, dtype=torch.float64)
    nothing, always = torch.zeros(rows, 2, dtype=torch.float64), torch.ones(rows, dtype=torch.bool)
    first = measured.sensitivity[:, 0], measured.true[:, 0]
    parameters, covariance = _absorbed(first, exact, nothing, always, parameters, covariance)
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
        noise, change = believe(output)
        pair = rate, measured.error[:, k]
        parameters, covariance = _absorbed(pair, noise, change, arrived, parameters, covariance)
        after.append(measured.true[:, k] - _product(rate, parameters))
        waited = torch.where(arrived, 0.0, waited) + measured.steps
    return torch.stack(before, 1), torch.stack(after, 1)


def loss(network: Gated, processing: Recurrent, measured: Measurements, delta_x: float, floor: float) -> Tensor:
    """The mean logarithm of what episodes cost: a part without deviations, and what the estimates are off.

    Args:
        network: Is trained.
        processing: What the filter begins with.
        measured: The episodes.
        delta_x: The error that costs 1 a step.
        floor: What a step costs where nothing is off.
    """
    out: Tensor = (costs(network, processing, measured, delta_x).mean(1) + floor).log().mean()
    return out


def costs(network: Speaker, processing: Recurrent, measured: Measurements, delta_x: float) -> Tensor:
    """What estimates are off costs, from each measurement to the next. Shape (B, T - 1).

    Args:
        network: Says what measurements are worth.
        processing: What the filter begins with.
        measured: The episodes.
        delta_x: The error that costs 1 a step.
    """
    before, after = errors(network, processing, measured)
    # In between, estimates are off by something between the two.
    return 0.5 * (after[:, :-1].square() + before[:, 1:].square()).sum(2) / delta_x**2


def _product(rate: Tensor, parameters: Tensor) -> Tensor:
    return (rate @ parameters[:, :, None])[:, :, 0]


def _absorbed(
    pair: tuple[Tensor, Tensor], noise: Tensor, change: Tensor, arrived: Tensor, parameters: Tensor, covariance: Tensor
) -> tuple[Tensor, Tensor]:
    """The filter's step.

    Args:
        pair: Derivatives and error, of shapes (B, 6, p) and (B, 6).
        noise: Variances. Shape (B, 6).
        change: Variances by which joint zeros change, each by itself, and all alike. Shape (B, 2).
        arrived: Rows that have a measurement. Shape (B,).
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
