"""Model-free adaptive control, which is the iteration of Levenberg and Marquardt (Zhang 2020, section III)."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from baselines.policy import Batch, Memory
from baselines.solvers.arm_task import arm_task_of, plain_arm_task, pose_arrays
from baselines.solvers.levenberg_marquardt.base import DampedIteration
from baselines.solvers.levenberg_marquardt.damping_rules import (
    DampingLaw,
    condition_number,
    condition_scratch,
    damping_next,
    damping_now,
)
from baselines.solvers.levenberg_marquardt.iteration import (
    APPLIED,
    CONVERGED,
    DEFICIENT,
    DIVERGED,
    LIMIT,
    RANK_TOLERANCE,
    stop_run_away,
)
from baselines.solvers.linear_algebra import damped_step, dot, pseudoinverse_rows
from ikgym import task_kernels
from ikgym.jit import kernel
from ikgym.kinematics import forward_and_jacobian


@dataclasses.dataclass(frozen=True, eq=False)
class ModelFreeAdaptiveControl(DampedIteration):
    """Goes to the next nominal point by damped least squares, again and again (eq. 11-17).

    At each period the model is iterated from the present joint coordinates:
    ``Δq_(i) = Jᵀ (J Jᵀ + λ_(i) I)⁻¹ e(y*(k+1), F(q_(i-1)))`` until ‖e‖ ≤ δ, the error being that of the task: for
    ``pose`` the rotation vector stands in for the printed arccos, which is 0/0 near 0. The printed (13) inverts
    JᵀJ + λ I; the form in the small space is the same and does not need n² numbers where J is flat.

    Statuses: ``converged`` where the model meets δ; ``iteration_limit`` where it does not, as for a point out of
    reach; ``rank_deficient`` where it does not and J had lost rank with a λ of 0, or too small to count, the
    directions lost being left out; ``diverged`` where the iterates are no numbers, or lead away from the point faster
    than the velocity limit: the arm is stopped for one step. The printed (14) takes back no bad step: out of reach,
    where λ falls while the Jacobian loses rank, it does not converge, while ``sugihara`` does.

    For a ramp of velocity v per period one step with a constant J leaves the error U diag(λ/σ²) Uᵀ v (eq. 10).

    Args:
        problem: What the policy is told of the scenario.
        rule: The rule for λ; it and the ten numbers behind it are those of :class:`DampedIteration`.
        tolerance: δ, norm of the error at which the iteration stops, in the units of the task, [m] and [rad].
        iterations: N_up, most iterations of one period.
        one_step: Whether to apply the controller (5) once to the measured pose; δ and N_up do not matter then, and
            the status is ``applied`` where J has full rank.

    Raises:
        InvalidInputError: A number is out of its range, or does not belong to the rule.
        UnknownNameError: There is no such rule.
    """

    rule: str = "error_ratio"

    name: ClassVar[str] = "mfac"

    def iterate(self, batch: Batch, memory: Memory, found: Memory) -> None:
        """See :meth:`DampedIteration.iterate`."""
        observed = batch.q, batch.pose, batch.nominal
        iterate_rows(plain_arm_task(self.problem), tuple(self.law), tuple(self.limits), observed, memory, found)


@kernel
def iterate_rows(arm_task, law, limits, observed, memory, found):
    """The iteration (11)-(17) row by row.

    Args:
        arm_task: The model of the arm and the task, a plain :class:`ArmTask`.
        law: A plain :class:`DampingLaw`.
        limits: Plain :class:`IterationLimits`.
        observed: A plain :class:`Observed`, its nominal coordinates of shape (B, at least 1, m).
        memory: A plain :class:`DampingMemory`, changed in place.
        found: Plain :class:`Iterates`, changed in place.
    """
    (chain, kind), rule = arm_task_of(arm_task), DampingLaw(*law)
    size, rank, longest, tolerance, most, one_step = limits
    start, poses, nominal = observed
    damping, error_before = memory
    q, status, iterations = found
    rotation, position, geometric, coordinates = pose_arrays(q.shape[1], poses.shape[1])
    # With the leading axis that the pseudoinverse wants; without it, as views made once.
    jacobians, errors, steps = np.empty((1, size, q.shape[1])), np.empty((1, size)), np.empty((1, q.shape[1]))
    jacobian, error, step, lost = jacobians[0], errors[0], steps[0], np.empty(1, dtype=np.bool_)
    gram, x, scratch = np.empty((size, size)), np.empty(size), condition_scratch(size, q.shape[1])
    for row in range(q.shape[0]):
        here, i, first = q[row], 0, 0.0
        status[row] = LIMIT
        while True:
            forward_and_jacobian(chain, here, rotation, position, geometric)  # (11), (12)
            task_kernels.jacobian(kind, rotation, geometric, jacobian)
            task_kernels.coordinates(kind, rotation, position, coordinates)
            task_kernels.error(kind, nominal[row, 0], poses[row] if one_step else coordinates, error)
            norm = np.sqrt(dot(error, error))
            if i == 0:
                first = norm
            if not np.isfinite(norm):
                status[row] = DIVERGED
                break
            if norm <= tolerance and not one_step:  # (16)
                status[row] = CONVERGED
                break
            if i == most:
                break
            condition = 1.0
            if rule.condition_bounds.shape[0] > 0:
                condition = condition_number(jacobian, rank, scratch)
            damping[row] = damping_now(rule, norm, condition, damping[row])
            if not damped_step(jacobian, error, damping[row], gram, x, step):  # (13)
                pseudoinverse_rows(jacobians, errors, RANK_TOLERANCE, rank, steps, lost)
                if lost[0]:
                    status[row] = DEFICIENT
            damping[row] = damping_next(rule, damping[row], norm, error_before[row])  # (14), (18)
            error_before[row] = norm
            for k in range(step.shape[0]):
                here[k] += step[k]  # (15), (17)
            i += 1
            if one_step:
                if status[row] == LIMIT:
                    status[row] = APPLIED
                break
        iterations[row] = i
        if not one_step and norm > first:
            stop_run_away(here, start[row], longest, status[row : row + 1])
        if status[row] == DIVERGED:
            here[:] = start[row]
            damping[row], error_before[row] = rule.damping, np.inf
