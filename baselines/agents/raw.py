"""The observation itself as features: what a model of Stable-Baselines3 sees that was trained on the environment."""

from __future__ import annotations

import dataclasses
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from baselines.agents.alone import Alone
from baselines.agents.features import Features
from baselines.policy import Batch, Problem
from ikgym.exceptions import InvalidInputError
from ikgym.preview import offsets as checked_offsets
from ikgym.validation import FloatArray, Frozen

#: The parts of the observation, in the order in which `Dict` spaces keep them, and so both Stable-Baselines3's
#: `MultiInputPolicy` and Gymnasium's `FlattenObservation`.
ORDER = ("nominal", "pose", "q", "qdot", "remaining")


@dataclasses.dataclass(frozen=True)
class RawObservation(Alone, Frozen):
    """All numbers of the observation as float32, part by part as in :data:`ORDER`; the network output is the action.

    Args:
        offsets: Steps ahead at which the nominal coordinates are seen.

    Raises:
        InvalidInputError: The offsets do not rise from 1 or more.
    """

    offsets: tuple[int, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "offsets", checked_offsets(self.offsets))

    @classmethod
    def of_size(cls, size: int, problem: Problem, offsets: tuple[int, ...] | None = None) -> Self:
        """What fills so many inputs.

        Args:
            size: Inputs of the network.
            problem: What the agent is told of the scenario.
            offsets: The steps ahead, which no size tells; 1, 2, … if left out.

        Raises:
            InvalidInputError: No preview fills so many inputs, or there are more or fewer offsets.
        """
        n, m = problem.model.joints, problem.task.size
        ahead, rest = divmod(size - (2 * n + m + 1), m)
        if ahead < 1 or rest:
            raise InvalidInputError(
                f"the observation of {n} joints and {m} task coordinates has {2 * n + m + 1} numbers and {m} for each "
                f"step ahead, which do not add up to the model's {size} inputs."
            )
        shown = tuple(range(1, ahead + 1)) if offsets is None else checked_offsets(offsets)
        if len(shown) != ahead:
            raise InvalidInputError(f"offsets: expected {ahead}, as many as the model sees, got {shown}.")
        return cls(shown)

    def size(self, problem: Problem) -> int:
        """The number of features."""
        m = problem.task.size
        return 2 * problem.model.joints + m + 1 + len(self.offsets) * m

    def outputs(self, problem: Problem) -> int:
        """The number of network outputs: one a joint."""
        return problem.model.joints

    def features(self, problem: Problem, batch: Batch, base: FloatArray | None = None) -> Features:
        """The features of a batch; see :meth:`baselines.agents.features.Processing.features`."""
        del problem, base
        parts = [getattr(batch, name).reshape(len(batch.q), -1) for name in ORDER]
        return np.concatenate(parts, axis=1, dtype=np.float32, casting="same_kind")

    def action(
        self, problem: Problem, batch: Batch, output: npt.NDArray[Any], base: FloatArray | None = None
    ) -> FloatArray:
        """The network output, in float64."""
        del problem, batch, base
        return output.astype(np.float64)
