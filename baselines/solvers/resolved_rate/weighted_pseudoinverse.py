"""Resolved rate by the pseudoinverse that weighs the joints."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from baselines.solvers.resolved_rate.moore_penrose import MoorePenrose
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray, per_joint


@dataclasses.dataclass(frozen=True, eq=False)
class WeightedPseudoinverse(MoorePenrose):
    """The smallest q̇ᵀ W q̇ that makes the task velocity: q̇ = W⁻¹ Jᵀ (J W⁻¹ Jᵀ)⁺ ẋ (Whitney 1969).

    Khan 2020 names the method in its introduction. With W = diag(w) it is q̇ = W^-½ (J W^-½)⁺ ẋ, so that
    the singular values are those of J W^-½: a joint with a large weight moves little, and the loss of rank is
    judged without it. With equal weights this is :class:`MoorePenrose`, and it fails where that fails.

    Args:
        problem: What the policy is told of the scenario.
        gain: Share of the present error that is taken back in one step; see :class:`ResolvedRate`.
        rank_tolerance: Singular values below this share of the largest count as zero. At least 0.
        weights: w, above 0; only their ratios count. One number, or one a joint; between revolute and prismatic
            joints it holds a unit, [m²] per [rad²].

    Raises:
        InvalidInputError: The gain, the tolerance or a weight is out of its range, or the weights are too few or
            too many.
    """

    weights: float | Sequence[float] = 1.0

    name: ClassVar[str] = "weighted_pseudoinverse"

    def __post_init__(self) -> None:
        super().__post_init__()
        weights = per_joint("weights", self.weights, self.problem.model.joints)
        if not (weights > 0.0).all():
            raise InvalidInputError(f"weights: expected numbers above 0, got {weights.tolist()}.")
        scalar = np.ndim(self.weights) == 0
        object.__setattr__(self, "weights", float(weights[0]) if scalar else tuple(weights.tolist()))

    def numbers(self) -> tuple[Any, ...]:
        """See :meth:`ResolvedRate.numbers`."""
        root = np.sqrt(np.broadcast_to(np.asarray(self.weights), self.problem.model.joints))
        return self.rank_tolerance, self.full_rank, root

    def invert(self, jacobian: FloatArray, shift: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """See :meth:`ResolvedRate.invert`."""
        root = np.sqrt(self.weights)
        step, status = super().invert(jacobian / root, shift)
        return step / root, status
