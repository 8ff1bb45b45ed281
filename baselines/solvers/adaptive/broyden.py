"""Damped least squares with a Jacobian that is learnt from measured poses by Broyden's formula."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Memory
from baselines.policy.parameters import parameter
from baselines.solvers.arm_task import task_shift
from baselines.solvers.resolved_rate.base import APPLIED, NominalMemory, finish
from baselines.solvers.resolved_rate.dls import DampedLeastSquares, damped_rows
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.validation import FloatArray, number


class BroydenMemory(NamedTuple):
    """Memory of the previous step.

    Attributes:
        nominal: X^N(k), see :class:`baselines.solvers.resolved_rate.base.NominalMemory`. Shape (B, m).
        known: Whether there was a step before. Shape (B,).
        learnt: The correction of the Jacobian. Shape (B, e, n).
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
    """

    nominal: FloatArray
    known: npt.NDArray[np.bool_]
    learnt: FloatArray
    q: FloatArray
    pose: FloatArray


class BroydenNumbers(NamedTuple):
    """The parameters of :class:`Broyden` as its kernel takes them.

    Attributes:
        gain: Share of the present error that is taken back in one step.
        damping: λ.
        motion: ε.
    """

    gain: float
    damping: float
    motion: float


@kernel
def broyden_step(model, numbers, seen, memory, answer):
    """One step of :class:`Broyden`; see :class:`CompiledPolicy` for the arguments."""
    q, pose, nominal = seen.q, seen.pose, seen.nominal
    before, known, _, q_before, pose_before = memory
    estimate = learn_rows(model, numbers, q, pose, memory)
    error, shift = np.empty(estimate.shape[1]), np.empty(estimate.shape[:2])
    for row in range(q.shape[0]):
        present = before[row] if known[row] else pose[row]
        task_shift(model.kind, numbers.gain, pose[row], nominal[row, 0], present, error, shift[row])
    damped_rows(estimate, shift, numbers.damping, answer.qdot)
    answer.status[:] = APPLIED
    finish(model, answer)
    for row in range(q.shape[0]):
        answer.iterations[row] = known[row]
        known[row] = True
        for i in range(before.shape[1]):
            before[row, i], pose_before[row, i] = nominal[row, 0, i], pose[row, i]
        for j in range(q.shape[1]):
            q_before[row, j] = q[row, j]


@inner
def learn_rows(model, numbers, q, pose, memory):
    """Estimates B of the Jacobian, row by row.

    Args:
        model: The :class:`Model`.
        numbers: The :class:`BroydenNumbers`.
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        memory: The :class:`BroydenMemory`; only what is learnt is changed, in place.

    Returns:
        B, of shape (B, e, n).
    """
    chain, kind = model.chain, model.kind
    _, had, corrections, q_before, pose_before = memory
    estimate = np.empty(corrections.shape)
    e, n = estimate.shape[1], estimate.shape[2]
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    error, moved, jacobian = np.empty(e), np.empty(n), np.zeros((e, n))
    for row in range(q.shape[0]):
        known, learnt = had[row], corrections[row]
        forward_and_jacobian(chain, q[row], rotation, position, geometric)
        task_kernels.jacobian(kind, rotation, geometric, jacobian)
        if known:
            square = numbers.motion * numbers.motion
            for k in range(n):
                moved[k] = q[row, k] - q_before[row, k]
                square += moved[k] * moved[k]
            task_kernels.error(kind, pose[row], pose_before[row], error)  # Δy
            _learn(jacobian, moved, square, error, learnt)
        for a in range(e):
            for k in range(n):
                estimate[row, a, k] = jacobian[a, k] + learnt[a, k]
    return estimate


@inner
def _learn(jacobian, moved, square, error, learnt):
    """Broyden's formula for one row: shapes (e, n), (n,), a number, (e,), which is overwritten, and (e, n)."""
    for a in range(error.shape[0]):
        for k in range(moved.shape[0]):
            error[a] -= (jacobian[a, k] + learnt[a, k]) * moved[k]
        for k in range(moved.shape[0]):
            learnt[a, k] += error[a] * moved[k] / square


@dataclasses.dataclass(frozen=True, eq=False)
class Broyden(DampedLeastSquares):
    """Learns from measured poses what the model does not know of the Jacobian (Broyden 1965, the "good" formula).

    When the joints have moved by Δq and the measured pose by Δy, the estimate B takes the smallest change that
    explains it: B ← B + (Δy − B Δq) Δqᵀ / (Δqᵀ Δq + ε²). The shift asked for is turned into joint velocities with B
    as in :class:`DampedLeastSquares`. The model may be wrong; measured poses must be good. For the task ``pose``,
    Δy is the change of position and the rotation vector from the pose before to the present one, in the base
    frame as the Jacobian is.

    A rank-one formula learns along the motion only; across it B stays what it was. So what is learnt is a correction,
    from 0, of the model's Jacobian at q; the formula acts on their sum. Broyden's method as it stands, where B only
    starts as the model's Jacobian, is lost on a long way or after a singular start.

    Args:
        problem: The scenario as the policy knows it.
        gain: Share of the present error that is taken back in one step; see :class:`ResolvedRate`.
        damping: λ, see :class:`DampedLeastSquares`.
        motion: ε, the length of a joint shift from which half is learnt, in [rad] or [m]; shorter ones say little,
            and a joint shift of 0 nothing. Above 0.

    Raises:
        InvalidInputError: The gain, the damping or ε is out of its range.
    """

    motion: float = parameter(1e-6, number, above=0.0)

    name: ClassVar[str] = "broyden"
    step = broyden_step

    def memory(self, rows: int) -> Memory:
        """A :class:`BroydenMemory` without a step before."""
        n, task = self.problem.model.joints, self.problem.task
        learnt = np.zeros((rows, task.error_size, n))
        before = NominalMemory(*super().memory(rows))
        q, pose = np.zeros((rows, n)), np.zeros((rows, task.size))
        return BroydenMemory(before.nominal, before.known, learnt, q, pose)

    def numbers(self) -> BroydenNumbers:  # type: ignore[override]  # of another kernel
        """See :meth:`CompiledPolicy.numbers`; iterations are 0 where nothing has been measured before, 1 later."""
        return BroydenNumbers(self.gain, self.damping, self.motion)
