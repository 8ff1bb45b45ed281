"""What an agent is made of: a transform of observations and actions, and an actor between them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from baselines.agents.features import Features
from baselines.policy import Batch, Problem
from ikgym.validation import FloatArray

NetworkT = TypeVar("NetworkT")
ProcessingT = TypeVar("ProcessingT")


class Transform(Protocol):
    """From observations to features, and from network outputs to actions.

    :class:`baselines.agents.features.Processing` is one, :class:`baselines.agents.raw.RawObservation` and
    :class:`baselines.agents.bilinear.processing.Bilinear` are others.
    """

    @property
    def offsets(self) -> tuple[int, ...]:
        """Steps ahead at which the nominal coordinates are seen."""

    @property
    def base_policy(self) -> str | None:
        """The policy that the agent corrects, as text; None for an agent that stands alone."""

    @property
    def null_space(self) -> float | None:
        """λ of the projector that network outputs go through; None where there is none."""

    def size(self, problem: Problem) -> int:
        """The number of features."""

    def outputs(self, problem: Problem) -> int:
        """The number of network outputs."""

    def features(self, problem: Problem, batch: Batch, base: FloatArray | None = None) -> Features:
        """The features of a batch. Shape (B, f)."""

    def action(
        self, problem: Problem, batch: Batch, output: npt.NDArray[Any], base: FloatArray | None = None
    ) -> FloatArray:
        """What network outputs mean, as fractions of the velocity limit. Shape (B, n)."""


class Described(Protocol):
    """What files say of how an agent comes from observations to actions."""

    @property
    def base_policy(self) -> str | None:
        """See :attr:`Transform.base_policy`."""

    def to_json(self) -> dict[str, Any]:
        """The fields, as JSON has them."""


class StoredTransform(Transform, Described, Protocol):
    """A transform that files can describe."""


class Actor(Protocol):
    """From features to network outputs, see :class:`baselines.agents.network.Network`."""

    @property
    def inputs(self) -> int:
        """The number of features."""

    @property
    def outputs(self) -> int:
        """The number of network outputs."""

    def forward(self, features: Features) -> npt.NDArray[np.float32]:
        """What the network says, row by row. Shape (B, outputs)."""


@dataclasses.dataclass(frozen=True, eq=False)
class FileOf(Generic[NetworkT, ProcessingT]):
    """What was read from the file of an agent.

    Args:
        source: The file, as messages name it.
        network: Its network.
        processing: How the network comes from observations to actions.
        about: What the file says of the agent: where it was trained, and how.
        hash: SHA-256 of what it is made of, in 64 hexadecimal digits.
    """

    source: str
    network: NetworkT
    processing: ProcessingT
    about: Mapping[str, Any]
    hash: str

    @property
    def digits(self) -> str:
        """The first digits of the hash, which stand in results."""
        return self.hash[:DIGITS]


class AgentFile(FileOf[Actor, Transform]):
    """An agent without memory that was read from a file."""


#: Digits of a hash that tell agents apart.
DIGITS = 12
