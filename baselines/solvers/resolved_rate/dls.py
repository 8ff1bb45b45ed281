"""Damped least squares: resolved rate with the deformation of Levenberg and Marquardt."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar

import numpy as np

from baselines.solvers.resolved_rate.base import APPLIED, ResolvedRate, add_feedback, task_motion, to_velocity
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.linear_algebra import cholesky, cholesky_solve, damped_gram, transposed_product
from ikgym.validation import Bounds


@inner
def damped_rows(jacobian, shift, damping, out):
    """Δq = Jᵀ (J Jᵀ + λ I)⁻¹ Δx, row by row: shapes (B, e, n), (B, e), a number, (B, n)."""
    e = jacobian.shape[1]
    gram, rhs = np.empty((e, e)), np.empty(e)
    for row in range(jacobian.shape[0]):
        damped_gram(jacobian[row], damping, gram)
        # Positive definite by the damping; if rounding says otherwise the damping is too small to count.
        if not cholesky(gram):
            out[row] = np.nan
            continue
        for a in range(e):
            rhs[a] = shift[row, a]
        cholesky_solve(gram, rhs)
        transposed_product(jacobian[row], rhs, out[row])


@kernel
def dls_step(model, numbers, batch, solution):
    """One step of :class:`DampedLeastSquares`; see :class:`CompiledPolicy` for the arguments."""
    jacobian, shift, error = task_motion(model, batch, solution.memory)
    add_feedback(numbers.gain, error, shift)
    damped_rows(jacobian, shift, numbers.damping, solution.qdot)
    solution.status[:] = APPLIED
    to_velocity(model, solution)


@dataclasses.dataclass(frozen=True, eq=False)
class DampedLeastSquares(ResolvedRate):
    """Minimises ‖Δx − J Δq‖² + λ ‖Δq‖²: Δq = Jᵀ (J Jᵀ + λ I)⁻¹ Δx (Khan 2020, section 2; Zhang 2020, eq. 9).

    Near a singularity the joint velocities stay bounded, at the price of a tracking error; away from one the error
    is about λ / σ² of the shift, with σ the singular values of J.

    Args:
        problem: The scenario as the policy knows it.
        gain: Fraction of the error corrected per step; see :class:`ResolvedRate`.
        damping: λ, added to J Jᵀ as it is, not squared. In the square of the Jacobian's units, [m²] and [1]. Above 0.

    Raises:
        InvalidInputError: The gain or the damping is out of its range.
    """

    damping: Annotated[float, Bounds(above=0.0)] = 1e-3

    name: ClassVar[str] = "dls"
    step = dls_step
