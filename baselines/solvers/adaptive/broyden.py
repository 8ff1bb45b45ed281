"""Damped least squares with a Jacobian that is learnt from measured poses by Broyden's formula."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Memory
from baselines.solvers.resolved_rate.base import APPLIED, NominalMemory, add_feedback, task_motion
from baselines.solvers.resolved_rate.dls import DampedLeastSquares, damped_rows
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.validation import Bounds, FloatArray


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


@kernel
def broyden_step(model, numbers, batch, solution):
    """One step of :class:`Broyden`; see :class:`CompiledPolicy` for the arguments.

    Iterations are 0 where nothing has been measured before, and 1 later.
    """
    memory = solution.memory
    solution.iterations[:] = memory.known
    nominal = NominalMemory(memory.nominal, memory.known)
    jacobian, shift, error = task_motion(model, batch, nominal)
    learn_rows(model.kind, numbers.motion, batch, solution.iterations, memory, jacobian)
    add_feedback(numbers.gain, error, shift)
    damped_rows(jacobian, shift, numbers.damping, solution.qdot)
    solution.status[:] = APPLIED
    for row in range(shift.shape[0]):
        for j in range(solution.qdot.shape[1]):
            solution.qdot[row, j] /= model.dt


@inner
def learn_rows(kind, motion, batch, had, memory, jacobian):
    """Makes estimates of Jacobians, row by row, and remembers the step.

    Args:
        kind: The kind of task coordinates.
        motion: ε.
        batch: The observations, a :class:`Batch`.
        had: Whether there was a step before. Shape (B,).
        memory: The :class:`BroydenMemory`, changed in place.
        jacobian: Those of the model; become their estimates B. Shape (B, e, n).
    """
    rows, e, n = jacobian.shape
    missing, moved = np.empty(e), np.empty(n)
    for row in range(rows):
        estimate, learnt = jacobian[row], memory.learnt[row]
        square = motion * motion
        for k in range(n):
            moved[k] = batch.q[row, k] - memory.q[row, k]
            square += moved[k] * moved[k]
        task_kernels.error(kind, batch.pose[row], memory.pose[row], missing)  # Δy
        for a in range(e):
            if had[row]:
                for k in range(n):
                    missing[a] -= (estimate[a, k] + learnt[a, k]) * moved[k]
                for k in range(n):
                    learnt[a, k] += missing[a] * moved[k] / square
            for k in range(n):
                estimate[a, k] += learnt[a, k]
        memory.q[row], memory.pose[row] = batch.q[row], batch.pose[row]


@dataclasses.dataclass(frozen=True, eq=False)
class Broyden(DampedLeastSquares):
    """Learns the error of the model's Jacobian from measured poses (Broyden 1965, the "good" formula).

    When the joints have moved by Δq and the measured pose by Δy, the estimate B takes the smallest change that
    explains it: B ← B + (Δy − B Δq) Δqᵀ / (Δqᵀ Δq + ε²). The shift asked for is turned into joint velocities with B
    as in :class:`DampedLeastSquares`. The model may be wrong; measured poses must be good. For the task ``pose``,
    Δy is the change of position and the rotation vector from the pose before to the present one, in the base
    frame as the Jacobian is.

    A rank-one formula learns along the motion only; across it B stays as it was. So it learns a correction,
    from 0, of the model's Jacobian at q; the formula acts on their sum. Broyden's method itself, where B only
    starts as the model's Jacobian, is lost on a long way or after a singular start.

    Args:
        problem: The scenario as the policy knows it.
        gain: Fraction of the error corrected per step; see :class:`ResolvedRate`.
        damping: λ, see :class:`DampedLeastSquares`.
        motion: ε, the length of a joint shift from which half is learnt, in [rad] or [m]; shorter ones say little,
            and a joint shift of 0 nothing. Above 0.

    Raises:
        InvalidInputError: The gain, the damping or ε is out of its range.
    """

    motion: Annotated[float, Bounds(above=0.0)] = 1e-6

    name: ClassVar[str] = "broyden"
    step = broyden_step

    def memory(self, rows: int) -> Memory:
        """A :class:`BroydenMemory` without a step before."""
        n, task = self.problem.model.joints, self.problem.task
        learnt = np.zeros((rows, task.error_size, n))
        before = NominalMemory(*super().memory(rows))
        q, pose = np.zeros((rows, n)), np.zeros((rows, task.size))
        return BroydenMemory(before.nominal, before.known, learnt, q, pose)
