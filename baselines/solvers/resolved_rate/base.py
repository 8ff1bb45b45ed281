"""Resolved rate: what all solvers share that answer a desired task velocity by one linear step."""

from __future__ import annotations

import abc
import dataclasses
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Solution, SolverPolicy
from baselines.solvers.arm_task import arm_task_of, plain_arm_task, pose_arrays, task_shift
from baselines.status import Status
from ikgym import task_kernels
from ikgym.exceptions import InvalidInputError
from ikgym.jit import kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.validation import FloatArray, number


class NominalMemory(NamedTuple):
    """What is remembered from the step before.

    Attributes:
        nominal: X^N(k), the nominal task coordinates that the step before was to reach. Shape (B, m).
        known: Whether there was a step before. Shape (B,).
    """

    nominal: FloatArray
    known: npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True, eq=False)
class ResolvedRate(SolverPolicy, abc.ABC):
    """Follows the nominal motion of the next step, and takes back a share of the present error.

    The shift asked for in one step is ``Δx = (X^N(k+1) - X^N(k)) + gain (X^N(k) - x(k))``, where X^N(k) is
    remembered from the step before (at the first step it is taken to be the measured pose). It is turned into
    ``q̇ Δt`` with the task Jacobian of the model at q(k), by a subclass.

    Args:
        problem: What the policy is told of the scenario.
        gain: Share of the present error that is taken back in one step, K Δt with the feedback gain K in [1/s].
            Above 0; 1 is deadbeat control, 2 the limit of stability.

    Raises:
        InvalidInputError: The gain is not between 0 and 2.
    """

    gain: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", number("gain", self.gain, above=0.0))
        if self.gain >= 2.0:
            raise InvalidInputError(f"gain: expected a number above 0 and below 2, got {self.gain:g}.")

    def memory(self, rows: int) -> Memory:
        """A :class:`NominalMemory` without a step before."""
        return NominalMemory(np.zeros((rows, self.problem.task.size)), np.zeros(rows, dtype=np.bool_))

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        before = NominalMemory(*memory)
        rows, n = batch.q.shape
        size = self.problem.task.error_size
        jacobian, shift = np.empty((rows, size, n)), np.empty((rows, size))
        task_shift_rows(
            plain_arm_task(self.problem),
            self.gain,
            (batch.q, batch.pose, np.ascontiguousarray(batch.nominal[:, 0])),
            np.where(before.known[:, None], before.nominal, batch.pose),
            jacobian,
            shift,
        )
        step, status = self.move(batch.q, jacobian, shift)
        remembered = NominalMemory(batch.nominal[:, 0].copy(), np.ones(rows, dtype=np.bool_))
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
def task_shift_rows(arm_task, gain, observed, present, jacobian, shift):
    """Task Jacobians and the task shifts asked for, row by row.

    Args:
        arm_task: The model of the arm and the task, a plain :class:`ArmTask`.
        gain: Share of the present error to take back.
        observed: A plain :class:`Observed` with X^N(k+1).
        present: X^N(k). Shape (B, m).
        jacobian: Receives the task Jacobians. Shape (B, e, n).
        shift: Receives the task shifts. Shape (B, e).
    """
    (chain, kind), (q, pose, target) = arm_task_of(arm_task), observed
    rotation, position, geometric, _ = pose_arrays(q.shape[1], pose.shape[1])
    error = np.empty(shift.shape[1])
    for row in range(q.shape[0]):
        forward_and_jacobian(chain, q[row], rotation, position, geometric)
        task_kernels.jacobian(kind, rotation, geometric, jacobian[row])
        task_shift(kind, gain, pose[row], target[row], present[row], error, shift[row])


def status_of(rank_deficient: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Statuses of rows by whether the Jacobian had lost rank. Shapes (B,)."""
    return np.where(rank_deficient, int(Status.RANK_DEFICIENT), int(Status.APPLIED))
