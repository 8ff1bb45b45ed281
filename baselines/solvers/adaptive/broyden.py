"""Damped least squares with a Jacobian that is learnt from measured poses by Broyden's formula."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Solution
from baselines.solvers.resolved_rate.base import task_shift
from baselines.solvers.resolved_rate.dls import DampedLeastSquares
from ikgym import task_kernels
from ikgym.exceptions import UnknownNameError
from ikgym.jit import kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.validation import number

LEARNS = ("correction", "jacobian")


@dataclasses.dataclass(frozen=True, eq=False)
class Broyden(DampedLeastSquares):
    """Learns from measured poses what the model does not know of the Jacobian (Broyden 1965, the "good" formula).

    When the joints have moved by Δq and the measured pose by Δy, the estimate B takes the smallest change that
    explains it: B ← B + (Δy − B Δq) Δqᵀ / (Δqᵀ Δq + ε²). The shift asked for is turned into joint velocities with B
    as in :class:`DampedLeastSquares`. The model may be wrong; measured poses must be good. For the task ``pose``,
    Δy is the change of position and the rotation vector from the pose before to the present one, in the base
    frame as the Jacobian is.

    A rank-one formula learns along the motion only; across it B stays what it was:

    - ``learns="jacobian"`` is Broyden's method as it stands: B starts as the model's Jacobian, and the model is not
      asked again before the next episode. It holds where the arm stays near the start, and is lost on a long
      way or after a singular start: joint velocities then saturate, and errors grow to the arm's size.
    - ``learns="correction"`` adds to the model's Jacobian at q, asked at each step, a correction that starts at 0;
      the formula acts on their sum. It is the default.

    Args:
        problem: What the policy is told of the scenario.
        gain: Share of the present error that is taken back in one step; see :class:`ResolvedRate`.
        damping: λ, see :class:`DampedLeastSquares`.
        learns: ``"correction"`` or ``"jacobian"``.
        motion: ε, the length of a joint shift from which half is learnt, in [rad] or [m]; shorter ones say little,
            and a joint shift of 0 nothing. Above 0.

    Raises:
        InvalidInputError: The gain, the damping or ε is out of its range.
        UnknownNameError: There is no such thing to learn.
    """

    learns: str = "correction"
    motion: float = 1e-6

    name: ClassVar[str] = "broyden"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.learns not in LEARNS:
            raise UnknownNameError("thing to learn", self.learns, LEARNS)
        object.__setattr__(self, "motion", number("motion", self.motion, above=0.0))

    def memory(self, rows: int) -> Memory:
        """As :meth:`ResolvedRate.memory`, then what is learnt, (B, e, n), and q and the pose of the step before."""
        n, task = self.problem.model.joints, self.problem.task
        learnt = np.zeros((rows, task.error_size, n))
        return *super().memory(rows), learnt, np.zeros((rows, n)), np.zeros((rows, task.size))

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`; iterations are 0 where nothing has been measured before, 1 later."""
        present, known, learnt, q, pose = memory
        learnt, estimate, shift = learnt.copy(), np.empty_like(learnt), np.empty(learnt.shape[:2])
        target = batch.nominal[:, 0].copy()
        learn_rows(
            self.problem.model.chain,
            self.problem.task.kind,
            self.gain,
            self.motion,
            self.learns == "correction",
            (batch.q, batch.pose, target),
            known,
            (q, pose, present),
            learnt,
            estimate,
            shift,
        )
        step, status = self.invert(estimate, shift)
        remembered = (target, np.ones_like(known), learnt, batch.q.copy(), batch.pose.copy())
        return Solution(step / self.problem.dt, remembered, status, known.astype(np.int64))

    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """One factorisation and one measurement; one Jacobian, where it is learnt at the start only."""
        return 0, 1 if self.learns == "correction" else 1 - iterations, 1, 1


@kernel
def learn_rows(chain, kind, gain, motion, correcting, now, known, before, learnt, estimate, shift):
    """Estimates of the Jacobian and the task shifts asked for, row by row.

    Args:
        chain: The model of the arm.
        kind: The kind of task coordinates.
        gain: Share of the present error to take back.
        motion: ε.
        correcting: Whether a correction of the model's Jacobian is learnt, or the Jacobian itself.
        now: Joint coordinates (B, n), measured task coordinates (B, m) and X^N(k+1) of shape (B, m).
        known: Whether there was a step before. Shape (B,).
        before: Joint and task coordinates at the step before, and X^N(k); as above.
        learnt: The correction or the Jacobian, changed in place. Shape (B, e, n).
        estimate: Receives B. Shape (B, e, n).
        shift: Receives the task shifts. Shape (B, e).
    """
    q, pose, target = now
    q_before, pose_before, present = before
    e, n = estimate.shape[1], estimate.shape[2]
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    error, moved, jacobian = np.empty(e), np.empty(n), np.zeros((e, n))
    for row in range(q.shape[0]):
        if correcting or not known[row]:
            forward_and_jacobian(chain, q[row], rotation, position, geometric)
            task_kernels.jacobian(kind, rotation, geometric, jacobian)
        if not correcting:
            if not known[row]:
                learnt[row] = jacobian
            jacobian[:] = 0.0
        if known[row]:
            square = motion * motion
            for k in range(n):
                moved[k] = q[row, k] - q_before[row, k]
                square += moved[k] * moved[k]
            task_kernels.error(kind, pose[row], pose_before[row], error)  # Δy
            for a in range(e):
                for k in range(n):
                    error[a] -= (jacobian[a, k] + learnt[row, a, k]) * moved[k]
                for k in range(n):
                    learnt[row, a, k] += error[a] * moved[k] / square
        for a in range(e):
            for k in range(n):
                estimate[row, a, k] = jacobian[a, k] + learnt[row, a, k]
        asked = present[row] if known[row] else pose[row]
        task_shift(kind, gain, pose[row], target[row], asked, error, shift[row])
