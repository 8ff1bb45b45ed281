"""Resolved rate by the pseudoinverse that weighs the joints."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from baselines.solvers.resolved_rate.base import check_weights, velocity_weights
from baselines.solvers.resolved_rate.moore_penrose import MoorePenrose
from ikgym.validation import as_given, read_only


@dataclasses.dataclass(frozen=True, eq=False)
class WeightedPseudoinverse(MoorePenrose):
    """The smallest q̇ᵀ W q̇ that makes the task velocity: q̇ = W⁻¹ Jᵀ (J W⁻¹ Jᵀ)⁺ ẋ (Whitney 1969).

    Khan 2020 names the method in its introduction. With W = diag(w) it is q̇ = W^-½ (J W^-½)⁺ ẋ, so that
    the singular values are those of J W^-½: a joint with a large weight moves little, and the loss of rank is
    judged without it. With equal weights this is :class:`MoorePenrose`, and it fails where that fails.

    Args:
        problem: The scenario as the policy knows it.
        gain: Fraction of the error corrected per step; see :class:`ResolvedRate`.
        rank_tolerance: Singular values below this share of the largest count as zero. At least 0.
        weights: w, above 0; only their ratios count. One number, or one a joint; between revolute and prismatic
            joints it holds a unit, [m²] per [rad²]. If left out, 1 / v² of the largest joint velocities v where the
            model has velocity limits, so that motions count relative to them; equal ones where it has none.

    Raises:
        InvalidInputError: The gain, the tolerance or a weight is out of its range, or the weights are too few or
            too many.
    """

    weights: float | Sequence[float] | None = None

    name: ClassVar[str] = "weighted_pseudoinverse"

    def __post_init__(self) -> None:
        super().__post_init__()
        by_velocity = velocity_weights(self.problem.model, self.problem.largest_qdot, 2.0)
        given = by_velocity if self.weights is None else self.weights
        weights = check_weights("weights", given, self.problem.model.joints)
        self._settle(weights=as_given(given, weights), root=read_only(np.sqrt(weights)))
