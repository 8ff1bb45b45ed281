"""Resolved rate by the transposed Jacobian: no matrix is inverted."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar

import numpy as np

from baselines.policy.compiled import derived
from baselines.solvers.arm_size import error_weights, radian
from baselines.solvers.resolved_rate.base import (
    APPLIED,
    ResolvedRate,
    add_feedback,
    full_rank,
    set_status,
    task_motion,
    to_velocity,
)
from ikgym.kernels.jit import inner, kernel
from ikgym.validation import Bounds, FloatArray, read_only


@inner
def transpose_rows(jacobian, shift, weights, tolerance, out, stuck):
    """Δq = α Jᵀ W² Δx row by row, and whether that is 0.

    Args:
        jacobian: J. Shape (B, e, n).
        shift: Δx. Shape (B, e).
        weights: The diagonal of W². Shape (e,).
        tolerance: Below which share of ‖W J‖ ‖W Δx‖ a gradient counts as zero.
        out: Receives Δq. Shape (B, n).
        stuck: Receives whether it is 0 though Δx is not. Shape (B,).
    """
    e, n = jacobian.shape[1], jacobian.shape[2]
    for row in range(jacobian.shape[0]):
        j, dx, dq = jacobian[row], shift[row], out[row]
        squared = size = wanted = length = 0.0
        for k in range(n):
            dq[k] = 0.0
            for a in range(e):
                dq[k] += j[a, k] * (weights[a] * dx[a])
                size += weights[a] * j[a, k] * j[a, k]
            squared += dq[k] * dq[k]
        for a in range(e):
            wanted += weights[a] * dx[a] * dx[a]
            made = 0.0
            for k in range(n):
                made += j[a, k] * dq[k]
            length += weights[a] * made * made
        none = squared <= tolerance * tolerance * size * wanted or length == 0.0
        stuck[row] = none and wanted > 0.0
        alpha = 0.0 if none else squared / length
        for k in range(n):
            dq[k] *= alpha


@kernel
def transpose_step(model, numbers, batch, solution):
    """One step of :class:`JacobianTranspose`; see :class:`CompiledPolicy` for the arguments."""
    jacobian, shift, error = task_motion(model, batch, solution.memory)
    add_feedback(numbers.gain, error, shift)
    stuck = np.empty(shift.shape[0], np.bool_)
    transpose_rows(jacobian, shift, numbers.weights, numbers.rank_tolerance, solution.qdot, stuck)
    set_status(stuck, solution.status)
    if shift.shape[1] != full_rank(jacobian):
        solution.status[:] = APPLIED
    to_velocity(model, solution)


@dataclasses.dataclass(frozen=True, eq=False)
class JacobianTranspose(ResolvedRate):
    """Goes down the gradient of ½ ‖W (Δx − J Δq)‖²: Δq = α Jᵀ W² Δx, with the α that goes furthest down.

    W weighs position and orientation against each other: 1 for positions, a length ℓ for orientations. The direction
    is that of Wolovich and Elliott 1984 and of Balestrino, De Maria and Sciavicco 1984; the step
    α = ΔxᵀJJᵀΔx / ‖JJᵀΔx‖² is the one that Buss 2004 prints, here of W J and W Δx. In one step an arm makes all of Δx
    only where W J has equal singular values; elsewhere it lags behind, the more so the more they differ, and the rest
    comes back through the measured error.

    Joint velocities are not bounded: where Δx lies along a direction that is nearly lost, with a singular value σ,
    the step is Δx / σ like that of the pseudoinverse. Where JᵀΔx is 0 the arm rests; the status then says
    ``rank_deficient``, unless the task has more coordinates than the arm can move at once, where JᵀΔx is 0 at the
    best fit too.

    Args:
        problem: The scenario as the policy knows it.
        gain: Fraction of the error corrected per step; see :class:`ResolvedRate`.
        rank_tolerance: ‖JᵀΔx‖ below this share of ‖J‖ ‖Δx‖ (Frobenius, weighed) counts as zero. At least 0.
        length: ℓ, the length that 1 rad, or 1 in a rotation matrix, counts as, in [m]. Above 0. If left out, chosen
            for the model, see :func:`baselines.solvers.arm_size.radian`.

    Raises:
        InvalidInputError: The gain, the tolerance or the length is out of its range.
    """

    rank_tolerance: Annotated[float, Bounds(at_least=0.0)] = 1e-12
    length: Annotated[float, Bounds(above=0.0)] | None = None
    #: The diagonal of W². Shape (e,).
    weights: FloatArray = derived()

    name: ClassVar[str] = "jacobian_transpose"
    step = transpose_step

    def __post_init__(self) -> None:
        super().__post_init__()
        length = radian(self.problem.model) if self.length is None else self.length
        self._settle(length=length, weights=read_only(error_weights(self.problem.task, length)))
