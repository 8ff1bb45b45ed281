"""Agents trained in the environments of :mod:`ikgym.rl`: the same features, and actions in the same unit."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, Literal, get_args

import numpy as np
import numpy.typing as npt

from baselines.agents.network import Network, forward_rows
from baselines.agents.processing import Held, Processing, check_offsets
from baselines.policy import Batch, Problem
from ikgym.kernels.jit import kernel
from ikgym.kernels.outcome import OBSERVED
from ikgym.rl.feature_kernels import observe_rows
from ikgym.rl.twists import shown_joints, twist_size
from ikgym.validation import FloatArray, known_name, number

Squash = Literal["clip", "tanh"]


@dataclasses.dataclass(frozen=True)
class Relative(Processing):
    """Joint velocities in units of the remaining twist, from the features of :class:`ikgym.rl.AgentObservation`.

    The velocity of a joint is a · s (0.2 + |v̂|), with a = gain · (network output), kept within ±largest.

    Args:
        offsets: Steps ahead at which the reference is seen, rising, at least two.
        furthest: Bound of |v̂|, above 0.
        largest: Bound of a, above 0.
        gain: Above 0.
        squash: The function that bounds a: `clip` clips it, `tanh` is largest · tanh(a / largest).

    Raises:
        InvalidInputError: A value is out of its range.
        UnknownNameError: There is no such squash.
    """

    offsets: tuple[int, ...]
    furthest: float
    largest: float = 1.0
    gain: float = 1.0
    squash: Squash = "clip"
    _ahead: npt.NDArray[np.int64] = dataclasses.field(init=False, repr=False, compare=False)

    kind: ClassVar[str] = "relative"
    #: Steps for which an action was held in the training.
    interval = 1

    def __post_init__(self) -> None:
        known_name("squash", self.squash, get_args(Squash))
        offsets, ahead = check_offsets(self.offsets)
        numbers = {name: number(name, getattr(self, name), above=0.0) for name in ("furthest", "largest", "gain")}
        for field, value in {"offsets": offsets, "_ahead": ahead, **numbers}.items():
            object.__setattr__(self, field, value)

    def size(self, problem: Problem) -> int:
        """The number of features."""
        kind = problem.task.kind
        w, shown = int(twist_size(kind)), int(shown_joints(kind, problem.model.chain.prismatic))
        return shown + len(self.offsets) * w + 3 + (w // 3 + 1) * problem.model.joints

    def outputs(self, problem: Problem) -> int:
        """The number of network outputs: one a joint."""
        return problem.model.joints

    def held(self, problem: Problem) -> int:
        """The number of values that are held between evaluations of the network: its outputs."""
        return problem.model.joints

    def act(self, problem: Problem, batch: Batch, network: Network, interval: int, held: Held) -> FloatArray:
        """See :meth:`Processing.act`."""
        out = np.empty(batch.q.shape)
        ahead = problem.task.kind, problem.model.chain, problem.dt, self._ahead, self.furthest
        meaning = self.squash == "tanh", self.gain, self.largest, problem.velocity_limit
        law_rows(ahead, meaning, network.constants, tuple(batch[: len(OBSERVED)]), interval, *held, out)
        return out


@kernel
def law_rows(ahead, meaning, network, batch, interval, held, left, out):
    """Features, network where it is due, and actions, row by row.

    Args:
        ahead: The first five arguments of :func:`ikgym.rl.feature_kernels.observe_rows`.
        meaning: Whether tanh bounds the velocities, `gain` and `largest` of :class:`Relative`, and the
            velocity limit in [rad/s] or [m/s], of shape (n,).
        network: The first five arguments of :func:`baselines.agents.network.forward_rows`.
        batch: q, q̇, pose, reference and steps left, as for `observe_rows`.
        interval: Steps from one evaluation of the network to the next.
        held: The outputs of the last evaluation, replaced where one is due. Shape (B, n).
        left: Steps until the next evaluation, counted down. Shape (B,).
        out: Receives fractions of the velocity limit. Shape (B, n).
    """
    kind, chain, dt, offsets, furthest = ahead
    squashed, gain, largest, velocity_limit = meaning
    weights, biases, sizes, activation, squash = network
    q, qdot, pose, nominal, remaining = batch
    features, unit = np.empty((q.shape[0], sizes[0]), np.float32), np.empty(q.shape[0])
    observe_rows(kind, chain, dt, offsets, furthest, q, qdot, pose, nominal, remaining, features, unit)
    output = np.empty((1, q.shape[1]), np.float32)
    for row in range(q.shape[0]):
        if left[row] == 0:
            left[row] = interval
            forward_rows(weights, biases, sizes, activation, squash, features[row : row + 1], output)
            held[row] = output[0]
        left[row] -= 1
        for j in range(q.shape[1]):
            a = gain * held[row, j]
            a = largest * math.tanh(a / largest) if squashed else min(max(a, -largest), largest)
            out[row, j] = a * unit[row] / velocity_limit[j]
