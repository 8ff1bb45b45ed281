"""Resolved rate by orthonormalising the rows of the Jacobian: a reconstruction."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar

import numpy as np

from baselines.solvers.resolved_rate.base import (
    ResolvedRate,
    add_feedback,
    full_rank,
    set_status,
    task_motion,
    to_velocity,
)
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.linear_algebra import dot
from ikgym.validation import Bounds


@inner
def orthonormal_rows(jacobian, shift, truncation, full_rank, out, deficient):
    """Δq along the orthonormalised rows of J, row by row of the batch.

    Args:
        jacobian: J. Shape (B, e, n).
        shift: Δx. Shape (B, e).
        truncation: Remainders below this share of the longest row are left out.
        full_rank: The rank that J has where nothing is lost.
        out: Receives Δq. Shape (B, n).
        deficient: Receives whether a row was left out. Shape (B,).
    """
    e, n = jacobian.shape[1], jacobian.shape[2]
    basis, given = np.empty((full_rank, n)), np.empty(full_rank)
    rest, wanted, free = np.empty((e, n)), np.empty(e), np.empty(e, dtype=np.bool_)
    for row in range(jacobian.shape[0]):
        for a in range(e):
            wanted[a], free[a] = shift[row, a], True
            for k in range(n):
                rest[a, k] = jacobian[row, a, k]
        out[row] = 0.0
        shortest = 0.0
        rank = 0
        while rank < full_rank:
            pick, longest = 0, -1.0
            for a in range(e):
                if free[a]:
                    square = dot(rest[a], rest[a])
                    if square > longest:
                        pick, longest = a, square
            if rank == 0:
                shortest = truncation * truncation * longest
            # Rounding leaves parts along the rows before: once more is enough.
            for b in range(rank):
                _take_off(rest, wanted, pick, basis[b], given[b])
            length = np.sqrt(dot(rest[pick], rest[pick]))
            if length == 0.0 or longest < shortest:
                break
            free[pick] = False
            for k in range(n):
                basis[rank, k] = rest[pick, k] / length
            given[rank] = wanted[pick] / length
            for k in range(n):
                out[row, k] += given[rank] * basis[rank, k]
            for a in range(e):
                if free[a]:
                    _take_off(rest, wanted, a, basis[rank], given[rank])
            rank += 1
        deficient[row] = rank < full_rank


@inner
def _take_off(rest, wanted, a, unit, given):
    """Subtracts the part along a unit vector from a row, and its contribution from the row's demand."""
    part = dot(rest[a], unit)
    for k in range(unit.shape[0]):
        rest[a, k] -= part * unit[k]
    wanted[a] -= part * given


@kernel
def gram_schmidt_step(model, numbers, batch, solution):
    """One step of :class:`GramSchmidt`; see :class:`CompiledPolicy` for the arguments."""
    jacobian, shift, error = task_motion(model, batch, solution.memory)
    add_feedback(numbers.gain, error, shift)
    deficient = np.empty(shift.shape[0], np.bool_)
    orthonormal_rows(jacobian, shift, numbers.truncation, full_rank(jacobian), solution.qdot, deficient)
    set_status(deficient, solution.status)
    to_velocity(model, solution)


@dataclasses.dataclass(frozen=True, eq=False)
class GramSchmidt(ResolvedRate):
    """A solution without a cost function, by Gram–Schmidt orthonormalisation: a RECONSTRUCTION.

    Khan 2020 (section 2, its reference 44) names a method that avoids the minimisation of any cost function by the
    Gram–Schmidt algorithm. The original text is not at hand; the rest is this project's reading of that sentence.

    The rows of J are orthonormalised one after another, the longest remainder first. A row a with the remainder
    ρ u (u of unit length) asks for Δx_a; the contribution of the rows before is subtracted, and the rest,
    divided by ρ, is given along u. So Δq lies in the span of the rows and makes Δx: without truncation and with
    full rank it is the Moore–Penrose solution, although no sum of squares was minimised. (Orthonormalised columns
    would make Δx too, but with joints at rest.)

    Rows whose remainder is too short are left out: their coordinates are not tracked, those kept are tracked
    exactly, unlike with the pseudoinverse, which spreads the error over all coordinates. The status then
    says ``rank_deficient``, and joint velocities jump where a row leaves or comes back. A task with redundant
    coordinates has at most six rows kept; which ones may change from step to step.

    Args:
        problem: The scenario as the policy knows it.
        gain: Fraction of the error corrected per step; see :class:`ResolvedRate`.
        truncation: Rows whose remainder is shorter than this share of the longest row are left out. At least 0 and
            below 1. Rows of positions and of orientations are compared as they are, in [m] and [1].

    Raises:
        InvalidInputError: The gain or the truncation is out of its range.
    """

    truncation: Annotated[float, Bounds(at_least=0.0, below=1.0)] = 1e-3

    name: ClassVar[str] = "gram_schmidt"
    step = gram_schmidt_step
