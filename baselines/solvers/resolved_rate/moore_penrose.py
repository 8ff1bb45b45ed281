"""Resolved rate by the Moore–Penrose pseudoinverse."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from baselines.solvers.linear_algebra import orthogonal_columns
from baselines.solvers.resolved_rate.base import ResolvedRate, status_of
from ikgym.exceptions import InvalidInputError
from ikgym.jit import kernel
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


@kernel
def pseudoinverse_rows(jacobian, shift, tolerance, full_rank, out, deficient):
    """Δq = J⁺ Δx by singular values, row by row.

    Args:
        jacobian: J. Shape (B, e, n).
        shift: Δx. Shape (B, e).
        tolerance: Singular values below this share of the largest count as zero.
        full_rank: The rank that J has where nothing is lost.
        out: Receives Δq. Shape (B, n).
        deficient: Receives whether the rank is lower. Shape (B,).
    """
    e, n = jacobian.shape[1], jacobian.shape[2]
    columns, left = np.empty((n, e)), np.empty((e, e))
    squares = np.empty(e)
    for row in range(jacobian.shape[0]):
        # Jᵀ = (V Σ) Uᵀ: the columns become V Σ, the rotations U.
        for a in range(e):
            for k in range(n):
                columns[k, a] = jacobian[row, a, k]
        orthogonal_columns(columns, left)
        largest = 0.0
        for a in range(e):
            squares[a] = 0.0
            for k in range(n):
                squares[a] += columns[k, a] * columns[k, a]
            largest = max(largest, squares[a])
        rank = 0
        out[row] = 0.0
        for a in range(e):
            if squares[a] <= tolerance * tolerance * largest or squares[a] == 0.0:
                continue
            rank += 1
            amount = 0.0
            for b in range(e):
                amount += left[b, a] * shift[row, b]
            amount /= squares[a]
            for k in range(n):
                out[row, k] += amount * columns[k, a]
        deficient[row] = rank < full_rank
