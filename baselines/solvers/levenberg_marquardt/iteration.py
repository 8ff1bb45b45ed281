"""The kernel of the iterations of Zhang 2020: damped least squares for the next point, or for those of a horizon."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from baselines.solvers.levenberg_marquardt.block_tridiagonal import damped_horizon_step
from baselines.solvers.levenberg_marquardt.damping import (
    DampingLaw,
    condition_number,
    condition_scratch,
    damping_next,
    damping_now,
)
from baselines.status import Status
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.kinematics import forward, forward_and_jacobian
from ikgym.kernels.linear_algebra import damped_step, dot, pseudoinverse_rows
from ikgym.validation import FloatArray

CONVERGED, APPLIED, LIMIT = int(Status.CONVERGED), int(Status.APPLIED), int(Status.ITERATION_LIMIT)
DEFICIENT, DIVERGED = int(Status.RANK_DEFICIENT), int(Status.DIVERGED)

#: Singular values below this share of the largest count as zero.
RANK_TOLERANCE = 1e-12


class DampingMemory(NamedTuple):
    """Memory of the previous step; a kernel changes it in place.

    Attributes:
        damping: λ. Shape (B,).
        error: Norm of the error before; infinite where there is none. Shape (B,).
    """

    damping: FloatArray
    error: FloatArray


@kernel
def iteration_step(model, numbers, batch, solution):
    """The iteration (34)-(41), with one point (11)-(17), row by row; see :class:`CompiledPolicy` for the arguments."""
    chain, kind, dt, rule = model.chain, model.kind, model.dt, DampingLaw(*numbers.law)
    tolerance, most, one_step, horizon = numbers.tolerance, numbers.iterations, numbers.one_step, numbers.points
    predicted, whole_horizon = numbers.predicted, numbers.whole_horizon
    starts, poses, nominal, memory = batch.q, batch.pose, batch.nominal, solution.memory
    (damping, error_before), (q, _, status, iterations) = memory, solution
    n, m = q.shape[1], poses.shape[1]
    size = task_kernels.error_size(kind, m)
    rank = min(size, n, 6)  # redundant coordinates add none
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    present, coordinates = np.empty(m), np.empty(m)
    path, jacobians = np.empty((horizon, n)), np.empty((horizon, size, n))
    residuals, error = np.empty((horizon, size)), np.empty(size)
    differences = residuals if horizon == 1 else np.empty((horizon, size))
    jacobian, residual = jacobians[0], residuals[0]
    blocks = np.empty((size, size)), np.empty((horizon, size, size)), np.empty((horizon, size))
    steps, lost, scratch = np.empty((horizon, n)), np.empty(horizon, dtype=np.bool_), condition_scratch(size, n)
    for row in range(q.shape[0]):
        start, here = starts[row], q[row]
        for k in range(n):
            here[k] = start[k]
        status[row], i, first = LIMIT, 0, 0.0
        if not numbers.carries:
            damping[row], error_before[row] = rule.damping, np.inf
        while True:
            # y(k)_(i), J(k)_(i) and the residuals of all points from there (55).
            forward_and_jacobian(chain, here, rotation, position, geometric)
            task_kernels.jacobian(kind, rotation, geometric, jacobian)
            task_kernels.coordinates(kind, rotation, position, present)
            for j in range(horizon):
                task_kernels.error(kind, nominal[row, j], poses[row] if one_step else present, residuals[j])
            # The rest of the predicted path: y(k+j)_(i) and J(k+j)_(i) (34), (35).
            first_square = dot(residual, residual)
            square = first_square
            for j in range(1, horizon):
                if i == 0:
                    square += dot(residuals[j], residuals[j])
                else:
                    if predicted:
                        forward_and_jacobian(chain, path[j], rotation, position, geometric)
                    else:
                        forward(chain, path[j], rotation, position)
                    task_kernels.coordinates(kind, rotation, position, coordinates)
                    task_kernels.error(kind, nominal[row, j], coordinates, error)
                    square += dot(error, error)
                if predicted and i > 0:
                    task_kernels.jacobian(kind, rotation, geometric, jacobians[j])
                else:
                    for a in range(size):
                        for k in range(n):
                            jacobians[j, a, k] = jacobian[a, k]
            norm = np.sqrt(square)
            if i == 0:
                first = first_square
            if not np.isfinite(norm):
                status[row] = DIVERGED
                break
            if (norm if whole_horizon else np.sqrt(first_square)) <= tolerance and not one_step:  # (16), (40)
                status[row] = CONVERGED
                break
            if i == most:
                break
            condition = 1.0
            if rule.condition_bounds.shape[0] > 0:
                for j in range(horizon if predicted and i > 0 else 1):
                    condition = max(condition, condition_number(jacobians[j], rank, scratch))
            damping[row] = damping_now(rule, norm, condition, damping[row])  # (37)
            if horizon == 1:
                solved = damped_step(jacobian, residual, damping[row], blocks[0], error, steps[0])  # (13)
            else:
                _difference(residuals, differences)
                solved = damped_horizon_step(jacobians, differences, damping[row], blocks, steps) == horizon  # (36)
            if not solved:
                pseudoinverse_rows(jacobians, differences, RANK_TOLERANCE, rank, steps, lost)  # (38)
                if lost.any():
                    status[row] = DEFICIENT
            damping[row] = damping_next(rule, damping[row], norm, error_before[row])  # (14), (18), (44)
            error_before[row] = norm
            _apply(steps, path, here)
            i += 1
            if one_step:
                if status[row] == LIMIT:
                    status[row] = APPLIED
                break
        iterations[row] = i
        if not one_step and first_square > first:
            stop_run_away(here, start, model.velocity_limit, dt, status[row : row + 1])
        finish(dt, rule, row, start, status[row], memory, here)


@kernel
def _difference(residuals, out):
    """D of :mod:`block_tridiagonal`: shapes (n, e)."""
    for j in range(residuals.shape[0]):
        for a in range(residuals.shape[1]):
            out[j, a] = residuals[j, a] - (residuals[j - 1, a] if j > 0 else 0.0)


@inner
def _apply(steps, path, here):
    """The predicted path (56), the first point of which is the next iterate (57), (41)."""
    for k in range(here.shape[0]):
        shifted = here[k]
        for j in range(steps.shape[0]):
            shifted += steps[j, k]
            path[j, k] = shifted
        here[k] = path[0, k]


@inner
def stop_run_away(here, start, unit, dt, status):
    """Marks a row that has not converged as diverged where a joint has moved farther than it can in one period.

    Args:
        here: Joint coordinates in [rad] or [m]. Shape (n,).
        start: Those at the start of the period. Shape (n,).
        unit: The velocity limit in [rad/s] or [m/s]. Shape (n,).
        dt: The period in [s].
        status: The row's status, changed in place. Shape (1,).
    """
    excess = -np.inf
    for k in range(here.shape[0]):
        excess = max(excess, abs(here[k] - start[k]) - dt * unit[k])
    if status[0] != CONVERGED and excess > 0.0:
        status[0] = DIVERGED


@kernel
def finish(dt, rule, row, start, status, memory, here):
    """Turns joint coordinates into joint velocities, and begins anew where the iteration has diverged.

    Args:
        dt: Δt in [s].
        rule: The :class:`DampingLaw`.
        row: Which arm.
        start: Joint coordinates at the start of the period, in [rad] or [m]. Shape (n,).
        status: The status of the row.
        memory: The :class:`DampingMemory`, changed in place.
        here: Joint coordinates at its end; become joint velocities in [rad/s] or [m/s]. Shape (n,).
    """
    diverged = status == DIVERGED
    for k in range(here.shape[0]):
        here[k] = ((start[k] if diverged else here[k]) - start[k]) / dt
    if diverged:
        memory.damping[row], memory.error[row] = rule.damping, np.inf
