"""The interface of processings: observations to features, network outputs to actions."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from baselines.agents.network import Network
from baselines.policy import Batch, Problem
from ikgym.frozen import Frozen
from ikgym.validation import FloatArray, known_names


class Held(NamedTuple):
    """The result of a network, held until its next evaluation.

    Attributes:
        values: Shape (B, k).
        left: Steps until the next evaluation. Shape (B,).
    """

    values: FloatArray
    left: npt.NDArray[np.int64]


class Processing(Frozen, abc.ABC):
    """Of an agent whose network is evaluated at intervals, and that acts in every step; the file holds its fields."""

    #: The name of the class in files.
    kind: ClassVar[str]
    #: Whether actions are kept within the limits of the arm, as those of the policy `qp`.
    bounded: ClassVar[bool] = True
    #: Steps from one evaluation of the network to the next in the training.
    interval: int

    def to_json(self) -> dict[str, Any]:
        """The kind and the fields, as JSON values."""
        values = {name: list(v) if isinstance(v, tuple) else v for name, v in self._fields().items()}
        return {"kind": self.kind, **values}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """The inverse of :meth:`to_json`; fields left out have their defaults.

        Raises:
            UnknownNameError: A key is not a field.
            InvalidInputError: A value is refused.
        """
        fields = [field.name for field in dataclasses.fields(cls) if field.init]  # type: ignore[arg-type]  # subclasses
        known_names("field of the processing", values, ["kind", *fields])
        return cls(**{name: tuple(v) if isinstance(v, list) else v for name, v in values.items() if name != "kind"})

    @abc.abstractmethod
    def steps(self, problem: Problem) -> tuple[int, ...]:
        """The steps ahead at which the agent sees the reference."""

    @abc.abstractmethod
    def size(self, problem: Problem) -> int:
        """The number of features."""

    @abc.abstractmethod
    def outputs(self, problem: Problem) -> int:
        """The number of network outputs."""

    @abc.abstractmethod
    def held_size(self, problem: Problem) -> int:
        """The number of values that are held between evaluations of the network."""

    @abc.abstractmethod
    def act(self, problem: Problem, batch: Batch, network: Network, interval: int, held: Held) -> FloatArray:
        """Actions as fractions of the velocity limit, possibly beyond the box.

        Args:
            problem: The problem as the agent sees it.
            batch: The observations.
            network: The network.
            interval: Steps from one evaluation of the network to the next.
            held: The values of the last evaluation; changed in place.

        Returns:
            Shape (B, n).
        """
