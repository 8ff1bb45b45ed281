"""Resolved rate by the Moore–Penrose pseudoinverse."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from baselines.solvers.linear_algebra import pseudoinverse_rows
from baselines.solvers.resolved_rate.base import ResolvedRate, status_of
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray, number


@dataclasses.dataclass(frozen=True, eq=False)
class MoorePenrose(ResolvedRate):
    """The smallest joint velocity that makes the task velocity asked for: q̇ = J⁺ ẋ (Varga 2021, eq. 1).

    Near a singularity the joint velocities grow without bound. Where the Jacobian has lost rank to working precision
    the pseudoinverse leaves those directions out, and the status says ``rank_deficient``; the formula
    Jᵀ (J Jᵀ)⁻¹ of Khan 2020, eq. 2.3 does not exist there.

    Args:
        problem: What the policy is told of the scenario.
        gain: Share of the present error that is taken back in one step; see :class:`ResolvedRate`.
        rank_tolerance: Singular values below this share of the largest count as zero. At least 0, below 1.

    Raises:
        InvalidInputError: The gain or the tolerance is out of its range.
    """

    rank_tolerance: float = 1e-12

    name: ClassVar[str] = "moore_penrose"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "rank_tolerance", number("rank_tolerance", self.rank_tolerance, at_least=0.0))
        if self.rank_tolerance >= 1.0:
            raise InvalidInputError(f"rank_tolerance: expected a number below 1, got {self.rank_tolerance:g}.")

    def invert(self, jacobian: FloatArray, shift: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """See :meth:`ResolvedRate.invert`."""
        rows, _, n = jacobian.shape
        out, deficient = np.empty((rows, n)), np.empty(rows, dtype=np.bool_)
        pseudoinverse_rows(jacobian, shift, self.rank_tolerance, self.full_rank, out, deficient)
        return out, status_of(deficient)
