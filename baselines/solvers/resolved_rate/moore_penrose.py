"""Resolved rate by the Moore–Penrose pseudoinverse."""

from __future__ import annotations

import abc
import dataclasses
from typing import Annotated, ClassVar

import numpy as np

from baselines.policy.compiled import derived
from baselines.solvers.resolved_rate.base import (
    ResolvedRate,
    add_feedback,
    full_rank,
    set_status,
    task_motion,
    to_velocity,
)
from ikgym.kernels.jit import kernel
from ikgym.kernels.linear_algebra import pseudoinverse_rows
from ikgym.validation import Bounds, FloatArray, read_only


@kernel
def pseudoinverse_step(model, numbers, batch, solution):
    """One step by the pseudoinverse, see :class:`CompiledPolicy` for the arguments."""
    jacobian, shift, error = task_motion(model, batch, solution.memory)
    add_feedback(numbers.gain, error, shift)
    root, qdot = numbers.root, solution.qdot
    deficient = np.empty(qdot.shape[0], np.bool_)
    pseudoinverse_rows(jacobian / root, shift, numbers.tolerance, full_rank(jacobian), qdot, deficient)
    set_status(deficient, solution.status)
    for row in range(qdot.shape[0]):
        for j in range(qdot.shape[1]):
            qdot[row, j] /= root[j]
    to_velocity(model, solution)


@dataclasses.dataclass(frozen=True, eq=False)
class Pseudoinverse(ResolvedRate, abc.ABC):
    """Base of solvers by the pseudoinverse.

    Args:
        problem: The scenario as the policy knows it.
        gain: See :class:`ResolvedRate`.
    """

    #: Singular values below this fraction of the largest count as zero.
    tolerance: float = derived()
    #: Divisors of the columns of J: the roots of the joints' weights. Shape (n,).
    root: FloatArray = derived()

    step = pseudoinverse_step

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle(root=read_only(np.ones(self.problem.model.joints)))


@dataclasses.dataclass(frozen=True, eq=False)
class MoorePenrose(Pseudoinverse):
    """The smallest joint velocity that makes the task velocity asked for: q̇ = J⁺ ẋ (Varga 2021, eq. 1).

    Near a singularity the joint velocities grow without bound. Where the Jacobian has lost rank to working precision
    the pseudoinverse leaves those directions out, and the status says ``rank_deficient``; the formula
    Jᵀ (J Jᵀ)⁻¹ of Khan 2020, eq. 2.3 does not exist there.

    Args:
        problem: The scenario as the policy knows it.
        gain: Fraction of the error corrected per step; see :class:`ResolvedRate`.
        rank_tolerance: Singular values below this share of the largest count as zero. At least 0, below 1.

    Raises:
        InvalidInputError: The gain or the tolerance is out of its range.
    """

    rank_tolerance: Annotated[float, Bounds(at_least=0.0, below=1.0)] = 1e-12

    name: ClassVar[str] = "moore_penrose"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle(tolerance=self.rank_tolerance)
