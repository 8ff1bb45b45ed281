"""Damped least squares: resolved rate with the deformation of Levenberg and Marquardt."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from baselines.policy import statuses
from baselines.policy_kernels import REFUSED, all_finite
from baselines.solvers.linear_algebra import damped_gram, transposed_product
from baselines.solvers.resolved_rate.base import APPLIED, ResolvedRate, answered, asked
from ikgym.jit import kernel
from ikgym.linear_algebra import cholesky, cholesky_solve
from ikgym.validation import FloatArray, number


@dataclasses.dataclass(frozen=True, eq=False)
class DampedLeastSquares(ResolvedRate):
    """Minimises ‖Δx − J Δq‖² + λ ‖Δq‖²: Δq = Jᵀ (J Jᵀ + λ I)⁻¹ Δx (Khan 2020, section 2; Zhang 2020, eq. 9).

    Near a singularity the joint velocities stay bounded, at the price of a tracking error; away from one the error
    is about λ / σ² of the shift, with σ the singular values of J.

    Args:
        problem: What the policy is told of the scenario.
        gain: Share of the present error that is taken back in one step; see :class:`ResolvedRate`.
        saturation: What is done about joint velocities beyond their limits; see :class:`ResolvedRate`.
        damping: λ, added to J Jᵀ as it is, not squared. In the square of the Jacobian's units, [m²] and [1]. Above 0.

    Raises:
        InvalidInputError: The gain or the damping is out of its range.
    """

    damping: float = 1e-3

    name: ClassVar[str] = "dls"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "damping", number("damping", self.damping, above=0.0))

    def kernel(self) -> Any:
        """See :meth:`CompiledPolicy.kernel`."""
        return dls_rows

    def numbers(self) -> tuple[Any, ...]:
        """See :meth:`ResolvedRate.numbers`."""
        return (self.damping,)

    def invert(self, jacobian: FloatArray, shift: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """See :meth:`ResolvedRate.invert`."""
        out = np.empty((len(jacobian), jacobian.shape[2]))
        damped_rows(jacobian, shift, self.damping, out)
        return out, statuses(len(out))


@kernel
def dls_rows(
    arm_task,
    gain,
    scaling,
    damping,
    checking,
    q,
    qdot_before,
    pose,
    nominal,
    remaining,
    before,
    known,
    action,
    answer,
):
    """One step of :class:`DampedLeastSquares`; see :class:`CompiledPolicy` for the arguments."""
    if checking and not all_finite(q, qdot_before, pose, nominal, remaining):
        return REFUSED
    q, jacobian, shift, parts = asked(arm_task, gain, q, pose, nominal, before, known, answer)
    qdot, status, _ = parts
    status[:] = APPLIED
    damped_rows(jacobian, shift, damping, qdot)
    return answered(arm_task, scaling, parts, action)


@kernel
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
        rhs[:] = shift[row]
        cholesky_solve(gram, rhs)
        transposed_product(jacobian[row], rhs, out[row])
