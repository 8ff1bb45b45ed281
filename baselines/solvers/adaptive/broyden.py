"""Damped least squares with a Jacobian that is learnt from measured poses by Broyden's formula."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Memory
from baselines.policy_kernels import REFUSED, all_finite, answer_parts, as_rows
from baselines.solvers.arm_task import arm_task_of, pose_arrays, task_shift
from baselines.solvers.resolved_rate.base import APPLIED, NominalMemory, answered
from baselines.solvers.resolved_rate.dls import DampedLeastSquares, damped_rows
from ikgym import task_kernels
from ikgym.jit import inlined, kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.validation import FloatArray, known_name, number

LEARNS = ("correction", "jacobian")


class BroydenMemory(NamedTuple):
    """What is remembered from the step before.

    Attributes:
        nominal: X^N(k), see :class:`baselines.solvers.resolved_rate.base.NominalMemory`. Shape (B, m).
        known: Whether there was a step before. Shape (B,).
        learnt: The correction of the Jacobian or the Jacobian. Shape (B, e, n).
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
    """

    nominal: FloatArray
    known: npt.NDArray[np.bool_]
    learnt: FloatArray
    q: FloatArray
    pose: FloatArray


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
        saturation: What is done about joint velocities beyond their limits; see :class:`ResolvedRate`.
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
        known_name("thing to learn", self.learns, LEARNS)
        object.__setattr__(self, "motion", number("motion", self.motion, above=0.0))

    def memory(self, rows: int) -> Memory:
        """A :class:`BroydenMemory` without a step before."""
        n, task = self.problem.model.joints, self.problem.task
        learnt = np.zeros((rows, task.error_size, n))
        before = NominalMemory(*super().memory(rows))
        q, pose = np.zeros((rows, n)), np.zeros((rows, task.size))
        return BroydenMemory(before.nominal, before.known, learnt, q, pose)

    def kernel(self) -> Any:
        """See :meth:`CompiledPolicy.kernel`; iterations are 0 where nothing has been measured before, 1 later."""
        return broyden_rows

    def numbers(self) -> tuple[Any, ...]:
        """See :meth:`ResolvedRate.numbers`."""
        return self.damping, self.motion, self.learns == "correction"


@kernel
def broyden_rows(
    arm_task,
    gain,
    scaling,
    damping,
    motion,
    correcting,
    checking,
    q,
    qdot_before,
    pose,
    nominal,
    remaining,
    before,
    known,
    learnt,
    q_before,
    pose_before,
    action,
    answer,
):
    """One step of :class:`Broyden`; see :class:`CompiledPolicy` for the arguments."""
    if checking and not all_finite(q, qdot_before, pose, nominal, remaining):
        return REFUSED
    q, pose, nominal = as_rows(int(arm_task[0]), q, pose, nominal)
    qdot, status, iterations = answer_parts(answer, q.shape[0], q.shape[1])
    target = nominal[:, 0].copy()
    estimate, shift = np.empty(learnt.shape), np.empty(learnt.shape[:2])
    memory = before, known, learnt, q_before, pose_before
    learn_rows(arm_task, (gain, motion, correcting), (q, pose, target), memory, estimate, shift)
    damped_rows(estimate, shift, damping, qdot)
    status[:] = APPLIED
    code = answered(arm_task, scaling, (qdot, status, iterations), action)
    for row in range(q.shape[0]):
        iterations[row] = known[row]
    before[:], known[:], q_before[:], pose_before[:] = target, True, q, pose
    return code


@kernel
def learn_rows(arm_task, rule, observed, memory, estimate, shift):
    """Estimates of the Jacobian and the task shifts asked for, row by row.

    Args:
        arm_task: The model of the arm and the task, a plain :class:`ArmTask`.
        rule: The share of the present error to take back, ε, and whether a correction of the model's Jacobian is
            learnt, or the Jacobian itself.
        observed: A plain :class:`Observed` with X^N(k+1).
        memory: A plain :class:`BroydenMemory`; what is learnt is changed in place.
        estimate: Receives B. Shape (B, e, n).
        shift: Receives the task shifts. Shape (B, e).
    """
    gain, motion, correcting = rule
    (chain, kind), (q, pose, target), before = arm_task_of(arm_task), observed, BroydenMemory(*memory)
    e, n = estimate.shape[1], estimate.shape[2]
    rotation, position, geometric, _ = pose_arrays(n, pose.shape[1])
    error, moved, jacobian = np.empty(e), np.empty(n), np.zeros((e, n))
    for row in range(q.shape[0]):
        known, learnt = before.known[row], before.learnt[row]
        if correcting or not known:
            forward_and_jacobian(chain, q[row], rotation, position, geometric)
            task_kernels.jacobian(kind, rotation, geometric, jacobian)
        if not correcting:
            if not known:
                learnt[:] = jacobian
            jacobian[:] = 0.0
        if known:
            square = motion * motion
            for k in range(n):
                moved[k] = q[row, k] - before.q[row, k]
                square += moved[k] * moved[k]
            task_kernels.error(kind, pose[row], before.pose[row], error)  # Δy
            _learn(jacobian, moved, square, error, learnt)
        for a in range(e):
            for k in range(n):
                estimate[row, a, k] = jacobian[a, k] + learnt[a, k]
        present = before.nominal[row] if known else pose[row]
        task_shift(kind, gain, pose[row], target[row], present, error, shift[row])


@inlined
def _learn(jacobian, moved, square, error, learnt):
    """Broyden's formula for one row: shapes (e, n), (n,), a number, (e,), which is overwritten, and (e, n)."""
    for a in range(error.shape[0]):
        for k in range(moved.shape[0]):
            error[a] -= (jacobian[a, k] + learnt[a, k]) * moved[k]
        for k in range(moved.shape[0]):
            learnt[a, k] += error[a] * moved[k] / square
