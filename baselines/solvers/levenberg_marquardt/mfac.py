"""Model-free adaptive control, which is the iteration of Levenberg and Marquardt (Zhang 2020, section III)."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from baselines.solvers.arm_task import pose_arrays
from baselines.solvers.levenberg_marquardt.base import (
    APPLIED,
    CONVERGED,
    DEFICIENT,
    DIVERGED,
    LIMIT,
    RANK_TOLERANCE,
    DampedIteration,
    begin,
    finish,
    stop_run_away,
)
from baselines.solvers.levenberg_marquardt.damping import (
    DampingLaw,
    condition_number,
    condition_scratch,
    damping_next,
    damping_now,
)
from baselines.solvers.linear_algebra import damped_step, dot, pseudoinverse_rows
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import kernel
from ikgym.kernels.kinematics import forward_and_jacobian


@kernel
def mfac_step(model, numbers, seen, memory, answer):
    """The iteration (11)-(17) row by row; see :class:`CompiledPolicy` for the arguments."""
    chain, kind, dt, rule = model.chain, model.kind, model.dt, DampingLaw(*numbers.law)
    size, rank, longest, tolerance = numbers.size, numbers.rank, numbers.longest, numbers.tolerance
    most, one_step, carry = numbers.most, numbers.one_step, numbers.carry
    starts, poses, nominal, (damping, error_before) = seen.q, seen.pose, seen.nominal, memory
    q, status, iterations = answer
    n = q.shape[1]
    rotation, position, geometric, coordinates = pose_arrays(n, poses.shape[1])
    # With the leading axis that the pseudoinverse wants; without it, as views made once.
    jacobians, errors, steps = np.empty((1, size, n)), np.empty((1, size)), np.empty((1, n))
    jacobian, error, step, lost = jacobians[0], errors[0], steps[0], np.empty(1, dtype=np.bool_)
    gram, x, scratch = np.empty((size, size)), np.empty(size), condition_scratch(size, n)
    for row in range(q.shape[0]):
        start, here, i, first = starts[row], q[row], 0, 0.0
        for k in range(n):
            here[k] = start[k]
        status[row] = LIMIT
        begin(rule, carry, row, memory)
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
            stop_run_away(here, start, longest, status[row : row + 1])
        finish(dt, rule, row, start, status[row], memory, here)


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
        problem: The scenario as the policy knows it.
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
    step = mfac_step
