"""PPO of agents with memory: they learn from the costs of estimates, without a gradient through the filter.

Noise is added to the output of the network at each measurement. Each episode is repeated several times, as a group in
which only the noise differs: the mean return of the others is the baseline of each (leave-one-out baseline, Kool et al.
2019), so that no critic is needed.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.distributions import Normal

from baselines.agents.recurrent.processing import Recurrent
from baselines.training.memory.episodes import Measurements, taken
from baselines.training.memory.filter import Gated, costs

#: Added to the variance of the advantages before the division by its root.
LITTLE = 1e-8


class Rollout(NamedTuple):
    """Features, outputs and advantages of B episodes. T is one less than the measurements of an episode.

    Attributes:
        features: Shape (B, T, f).
        outputs: With noise. Shape (B, T, o).
        arrived: Whether there was a measurement. Shape (B, T).
        log_prob: Logarithms of the probability densities of the outputs. Shape (B, T).
        advantages: Shape (B, T).
    """

    features: Tensor
    outputs: Tensor
    arrived: Tensor
    log_prob: Tensor
    advantages: Tensor


class Exploring:
    """A network with noise on its outputs, which records features and outputs.

    Args:
        network: The network; it is not changed.
        std: Standard deviation of the noise.
    """

    def __init__(self, network: Gated, std: float) -> None:
        self._network, self._std = network, std
        self.seen: list[Tensor] = []
        self.means: list[Tensor] = []
        self.outputs: list[Tensor] = []

    @property
    def dtype(self) -> torch.dtype:
        """Of the features."""
        return self._network.dtype

    def start(self, rows: int) -> list[Tensor]:
        """See :class:`Gated`."""
        return self._network.start(rows)

    def __call__(self, x: Tensor, hidden: list[Tensor], /) -> tuple[Tensor, list[Tensor]]:
        """See :class:`Gated`."""
        mean, after = self._network(x, hidden)
        output = mean + self._std * torch.randn_like(mean)
        for kept, part in ((self.seen, x), (self.means, mean), (self.outputs, output)):
            kept.append(part)
        return output, after


def explored(
    network: Gated,
    processing: Recurrent,
    measured: Measurements,
    delta_x: float,
    floor: float,
    *,
    std: float,
    group_size: int,
    gamma: float,
) -> Rollout:
    """Plays each episode as often as a group has members.

    Rewards are minus the costs of estimates ÷ the mean cost of the episode in its group, so that their sum maximises
    minus the logarithm of the costs of episodes, as :func:`baselines.training.memory.filter.loss` does.

    Args:
        network: Tunes the filter.
        processing: The prior of the filter.
        measured: The episodes.
        delta_x: The error that costs 1 a step.
        floor: The cost of a step without error.
        std: Standard deviation of the noise on outputs.
        group_size: At least 2.
        gamma: Discount factor, from one measurement to the next.
    """
    again = taken(measured, torch.arange(len(measured.arrived)).repeat_interleave(group_size))
    exploring = Exploring(network, std)
    with torch.no_grad():
        spent = costs(exploring, processing, again, delta_x)
        usual = spent.mean(1).reshape(-1, group_size).mean(1).repeat_interleave(group_size) + floor
        features, means, outputs = (
            torch.stack(x[:-1], 1) for x in (exploring.seen, exploring.means, exploring.outputs)
        )
        log_prob = _log_prob(outputs, means, std)
        returns = -(spent / usual[:, None])
        for k in range(returns.shape[1] - 2, -1, -1):
            returns[:, k] += gamma * returns[:, k + 1]
    advantages = torch.from_numpy(np.ascontiguousarray(_leave_one_out(returns.T.numpy(), group_size).T))
    return Rollout(features, outputs, again.arrived[:, :-1], log_prob, advantages)


def surrogate(network: Gated, rollout: Rollout, std: float, clip_range: float) -> Tensor:
    """The clipped objective of PPO with a minus sign (Schulman et al. 2017, eq. 7).

    Args:
        network: The network that is trained.
        rollout: From :func:`explored`.
        std: Standard deviation of the noise on outputs.
        clip_range: Largest distance of the ratio of probabilities from 1.
    """
    features, outputs, arrived, log_prob, advantages = rollout
    hidden, means = network.start(len(features)), []
    for k in range(features.shape[1]):
        mean, fresh = network(features[:, k], hidden)
        means.append(mean)
        hidden = [torch.where(arrived[:, k, None], new, old) for new, old in zip(fresh, hidden, strict=True)]
    ratio = (_log_prob(outputs, torch.stack(means, 1), std) - log_prob).exp()
    scaled = advantages / (advantages[arrived].square().mean() + LITTLE).sqrt()
    least = torch.minimum(ratio * scaled, ratio.clamp(1.0 - clip_range, 1.0 + clip_range) * scaled)
    out: Tensor = -least[arrived].mean()
    return out


def _leave_one_out(returns: npt.NDArray[np.float64], group_size: int) -> npt.NDArray[np.float32]:
    """Returns of shape (T, N), each minus the mean of the others of its group (Kool et al. 2019)."""
    groups = returns.astype(np.float32).reshape(len(returns), -1, group_size)
    relative = (groups - groups.mean(axis=2, keepdims=True)) * (group_size / (group_size - 1))
    out: npt.NDArray[np.float32] = relative.reshape(returns.shape).astype(np.float32)
    return out


def _log_prob(outputs: Tensor, means: Tensor, std: float) -> Tensor:
    """Of the outputs at each measurement. Shape (B, T)."""
    noise: Any = Normal(means, std)
    out: Tensor = noise.log_prob(outputs).sum(2)
    return out
