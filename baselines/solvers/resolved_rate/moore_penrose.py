"""Resolved rate by the Moore–Penrose pseudoinverse."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from baselines.policy_kernels import REFUSED, all_finite
from baselines.solvers.linear_algebra import pseudoinverse_rows
from baselines.solvers.resolved_rate.base import ResolvedRate, answered, asked, say_deficient, status_of
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
        saturation: What is done about joint velocities beyond their limits; see :class:`ResolvedRate`.
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

    def kernel(self) -> Any:
        """See :meth:`CompiledPolicy.kernel`."""
        return pseudoinverse_step_rows

    def numbers(self) -> tuple[Any, ...]:
        """See :meth:`ResolvedRate.numbers`."""
        return self.rank_tolerance, self.full_rank, np.ones(self.problem.model.joints)

    def invert(self, jacobian: FloatArray, shift: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """See :meth:`ResolvedRate.invert`."""
        rows, _, n = jacobian.shape
        out, deficient = np.empty((rows, n)), np.empty(rows, dtype=np.bool_)
        pseudoinverse_rows(jacobian, shift, self.rank_tolerance, self.full_rank, out, deficient)
        return out, status_of(deficient)


@kernel
def pseudoinverse_step_rows(
    arm_task,
    gain,
    scaling,
    tolerance,
    full_rank,
    root,
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
    """One step by the pseudoinverse, the columns of J divided by ``root`` (n,); else see :class:`CompiledPolicy`."""
    if checking and not all_finite(q, qdot_before, pose, nominal, remaining):
        return REFUSED
    q, jacobian, shift, parts = asked(arm_task, gain, q, pose, nominal, before, known, answer)
    qdot, status, _ = parts
    deficient = np.empty(q.shape[0], np.bool_)
    pseudoinverse_rows(jacobian / root, shift, tolerance, full_rank, qdot, deficient)
    say_deficient(deficient, status)
    for row in range(q.shape[0]):
        for j in range(q.shape[1]):
            qdot[row, j] /= root[j]
    return answered(arm_task, scaling, parts, action)
