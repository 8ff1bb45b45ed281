"""What an agent is put together from: something that sees, and something that answers."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from baselines.agents.features import Features
from baselines.policy import Batch, Problem
from ikgym.validation import FloatArray


class Sees(Protocol):
    """From observations to features, and from answers to actions: :class:`baselines.agents.features.Processing`."""

    @property
    def offsets(self) -> tuple[int, ...]:
        """Steps ahead at which the nominal coordinates are seen."""

    @property
    def base_policy(self) -> str | None:
        """The policy under the agent."""

    @property
    def null_space(self) -> float | None:
        """λ of the projector that answers go through; None where there is none."""

    def size(self, problem: Problem) -> int:
        """The number of features."""

    def features(self, problem: Problem, batch: Batch, base: FloatArray | None = None) -> Features:
        """The features of a batch. Shape (B, f)."""

    def action(
        self, problem: Problem, batch: Batch, answer: npt.NDArray[Any], base: FloatArray | None = None
    ) -> FloatArray:
        """What answers mean, as fractions of the velocity limit. Shape (B, n)."""


class Answers(Protocol):
    """From features to answers, see :class:`baselines.agents.network.Network`."""

    @property
    def inputs(self) -> int:
        """The number of features."""

    @property
    def outputs(self) -> int:
        """The number of answers."""

    def answer(self, features: Features) -> npt.NDArray[np.float32]:
        """Numbers in [-1, 1], row by row. Shape (B, n)."""


@dataclasses.dataclass(frozen=True, eq=False)
class AgentFile:
    """An agent that was read from a file.

    Args:
        source: The file, as messages name it.
        network: What answers.
        processing: What it sees, and what its answers mean.
        about: What the file says of the agent: where it was trained, and how.
        hash: SHA-256 of what it is made of, in 64 hexadecimal digits.
    """

    source: str
    network: Answers
    processing: Sees
    about: Mapping[str, Any]
    hash: str

    @property
    def digits(self) -> str:
        """The first digits of the hash, which stand in results."""
        return self.hash[:DIGITS]


#: Digits of a hash that tell agents apart.
DIGITS = 12
