"""Resolved rate: what all solvers share that answer a desired task velocity by one linear step."""

from __future__ import annotations

import abc
import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Solution, SolverPolicy
from baselines.status import Status
from ikgym import task_kernels
from ikgym.exceptions import InvalidInputError
from ikgym.jit import kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.validation import FloatArray, number


@dataclasses.dataclass(frozen=True, eq=False)
class ResolvedRate(SolverPolicy, abc.ABC):
    """Follows the nominal motion of the next step, and takes back a share of the present error.

    The shift asked for in one step is ``Δx = (X^N(k+1) - X^N(k)) + gain (X^N(k) - x(k))``, where X^N(k) is
    remembered from the step before (at the first step it is taken to be the measured pose). It is turned into
    ``q̇ Δt`` with the task Jacobian of the model at q(k), by a subclass.

    Args:
        problem: What the policy is told of the scenario.
        gain: Share of the present error that is taken back in one step, K Δt with the feedback gain K in [1/s].
            Above 0; 1 is dead beat, 2 the limit of stability.

    Raises:
        InvalidInputError: The gain is not between 0 and 2.
    """

    gain: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", number("gain", self.gain, above=0.0))
        if self.gain >= 2.0:
            raise InvalidInputError(f"gain: expected a number above 0 and below 2, got {self.gain:g}.")

    def memory(self, rows: int) -> Memory:
        """X^N(k), of shape (B, m), and whether it is known, of shape (B,)."""
        return np.zeros((rows, self.problem.task.size)), np.zeros(rows, dtype=np.bool_)

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        present, known = memory
        rows, n = batch.q.shape
        size = self.problem.task.error_size
        jacobian, shift = np.empty((rows, size, n)), np.empty((rows, size))
        linearise(
            self.problem.model.chain,
            self.problem.task.kind,
            self.gain,
            batch.q,
            batch.pose,
            np.ascontiguousarray(batch.nominal[:, 0]),
            np.where(known[:, None], present, batch.pose),
            jacobian,
            shift,
        )
        step, status = self.move(batch.q, jacobian, shift)
        remembered = (batch.nominal[:, 0].copy(), np.ones(rows, dtype=np.bool_))
        return Solution(step / self.problem.dt, remembered, status, np.ones(rows, dtype=np.int64))

    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """One Jacobian, one factorisation, one measurement."""
        return 0, 1, 1, 1

    @property
    def full_rank(self) -> int:
        """The rank that the task Jacobian has where nothing is lost: redundant coordinates add none."""
        return min(self.problem.task.error_size, self.problem.model.joints, 6)

    def move(self, q: FloatArray, jacobian: FloatArray, shift: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """As :meth:`invert`, for those that want more than the task: they are told where the joints are, (B, n)."""
        del q
        return self.invert(jacobian, shift)

    @abc.abstractmethod
    def invert(self, jacobian: FloatArray, shift: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """The joint shifts for task shifts.

        Args:
            jacobian: Task Jacobians. Shape (B, e, n).
            shift: Task shifts. Shape (B, e).

        Returns:
            Joint shifts in [rad] or [m], of shape (B, n), and values of :class:`Status`, of shape (B,).
        """


@kernel
def linearise(chain, kind, gain, q, pose, target, present, jacobian, shift):
    """Task Jacobians and the task shifts asked for, row by row.

    Args:
        chain: The model of the arm.
        kind: The kind of task coordinates.
        gain: Share of the present error to take back.
        q: Joint coordinates. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        target: X^N(k+1). Shape (B, m).
        present: X^N(k). Shape (B, m).
        jacobian: Receives the task Jacobians. Shape (B, e, n).
        shift: Receives the task shifts. Shape (B, e).
    """
    rotation, position = np.empty((3, 3)), np.empty(3)
    geometric = np.empty((6, q.shape[1]))
    error = np.empty(shift.shape[1])
    for row in range(q.shape[0]):
        forward_and_jacobian(chain, q[row], rotation, position, geometric)
        task_kernels.jacobian(kind, rotation, geometric, jacobian[row])
        task_shift(kind, gain, pose[row], target[row], present[row], error, shift[row])


@kernel
def task_shift(kind, gain, pose, target, present, error, shift):
    """Δx = (X^N(k+1) - X^N(k)) + gain (X^N(k) - x(k)) of one row; ``error`` (e,) receives the last difference."""
    task_kernels.error(kind, target, present, shift)
    task_kernels.error(kind, present, pose, error)
    for i in range(error.shape[0]):
        shift[i] += gain * error[i]


def status_of(rank_deficient: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Statuses of rows by whether the Jacobian had lost rank. Shapes (B,)."""
    return np.where(rank_deficient, int(Status.RANK_DEFICIENT), int(Status.CONVERGED))
