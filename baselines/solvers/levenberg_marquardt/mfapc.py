"""Model-free adaptive predictive control: damped least squares over a horizon (Zhang 2020, sections IV and V)."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from baselines.policy.parameters import choice, parameter
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
from baselines.solvers.levenberg_marquardt.block_tridiagonal import damped_horizon_step
from baselines.solvers.levenberg_marquardt.damping import (
    DampingLaw,
    condition_number,
    condition_scratch,
    damping_next,
    damping_now,
)
from baselines.solvers.linear_algebra import dot, pseudoinverse_rows
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.kinematics import forward, forward_and_jacobian
from ikgym.validation import whole_number


@kernel
def mfapc_step(model, numbers, seen, memory, answer):
    """The iteration (34)-(41) row by row; see :class:`CompiledPolicy` for the arguments."""
    chain, kind, dt, rule = model.chain, model.kind, model.dt, DampingLaw(*numbers.law)
    size, rank, longest, tolerance = numbers.size, numbers.rank, numbers.longest, numbers.tolerance
    most, one_step, carry = numbers.most, numbers.one_step, numbers.carry
    horizon, predicted, whole_horizon = numbers.horizon, numbers.predicted, numbers.whole_horizon
    starts, poses, nominal, (damping, error_before) = seen.q, seen.pose, seen.nominal, memory
    q, status, iterations = answer
    n, m = q.shape[1], poses.shape[1]
    rotation, position, geometric, coordinates = pose_arrays(n, m)
    present, path, jacobians = np.empty(m), np.empty((horizon, n)), np.empty((horizon, size, n))
    residuals, differences, error = np.empty((horizon, size)), np.empty((horizon, size)), np.empty(size)
    blocks = np.empty((size, size)), np.empty((horizon, size, size)), np.empty((horizon, size))
    steps, lost, scratch = np.empty((horizon, n)), np.empty(horizon, dtype=np.bool_), condition_scratch(size, n)
    for row in range(q.shape[0]):
        start, here = starts[row], q[row]
        for k in range(n):
            here[k] = start[k]
        status[row], i, first = LIMIT, 0, 0.0
        begin(rule, carry, row, memory)
        while True:
            # y(k)_(i), J(k)_(i) and the residuals of all points from there (55).
            forward_and_jacobian(chain, here, rotation, position, geometric)
            task_kernels.jacobian(kind, rotation, geometric, jacobians[0])
            task_kernels.coordinates(kind, rotation, position, present)
            for j in range(horizon):
                task_kernels.error(kind, nominal[row, j], poses[row] if one_step else present, residuals[j])
            # The rest of the predicted path: y(k+j)_(i) and J(k+j)_(i) (34), (35).
            first_square = dot(residuals[0], residuals[0])
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
                            jacobians[j, a, k] = jacobians[0, a, k]
            norm = np.sqrt(square)
            if i == 0:
                first = first_square
            if not np.isfinite(norm):
                status[row] = DIVERGED
                break
            if (norm if whole_horizon else np.sqrt(first_square)) <= tolerance and not one_step:  # (40)
                status[row] = CONVERGED
                break
            if i == most:
                break
            condition = 1.0
            if rule.condition_bounds.shape[0] > 0:
                for j in range(horizon if predicted and i > 0 else 1):
                    condition = max(condition, condition_number(jacobians[j], rank, scratch))
            damping[row] = damping_now(rule, norm, condition, damping[row])  # (37)
            _difference(residuals, differences)
            solved = damped_horizon_step(jacobians, differences, damping[row], blocks, steps)  # (36)
            if solved < horizon:
                pseudoinverse_rows(jacobians, differences, RANK_TOLERANCE, rank, steps, lost)  # (38)
                if lost.any():
                    status[row] = DEFICIENT
            damping[row] = damping_next(rule, damping[row], norm, error_before[row])  # (44)
            error_before[row] = norm
            _apply(steps, path, here)
            i += 1
            if one_step:
                if status[row] == LIMIT:
                    status[row] = APPLIED
                break
        iterations[row] = i
        if not one_step and first_square > first:
            stop_run_away(here, start, longest, status[row : row + 1])
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


@dataclasses.dataclass(frozen=True, eq=False)
class ModelFreeAdaptivePredictiveControl(DampedIteration):
    """Goes towards the next n nominal points at once, by damped least squares of the joint shifts between them.

    At each iteration all residuals are taken from the present iterate, r_j = e(y*(k+j), F(q_(i-1))), and
    ``ΔQ = (Ψ̄ᵀ Ψ̄ + λ I)⁻¹ Ψ̄ᵀ r`` (36) is solved block by block, see
    :mod:`levenberg_marquardt.block_tridiagonal`; only the first
    shift is kept (57). The Jacobians belong to the iterate itself or, from the second iteration on, to the
    path that ΔQ predicts (56); the paper says of the first only that it begins at q(k). With n = 1 this is
    :class:`mfac.ModelFreeAdaptiveControl`, and so is the first shift at λ = 0 (38) for any n.

    The test (40) asks that the whole predicted path meet its points. At λ = 0 the points behind the first are met
    but to the second order of the motion per period, and with λ > 0 the first shift vanishes beside the point, where
    the terms of the points ahead and of the first one cancel: on a moving trajectory the printed δ is out of reach and
    the status ``iteration_limit``. ``stop="first_point"`` asks it of the point that the arm is sent to only.

    Statuses are those of :class:`baselines.solvers.levenberg_marquardt.mfac.ModelFreeAdaptiveControl`.

    Args:
        problem: The scenario as the policy knows it.
        rule: The rule for λ; it and the ten numbers behind it are those of :class:`DampedIteration`. Its error is
            the norm of (40), its condition number the largest over the horizon (37).
        tolerance: δ, norm of the error at which the iteration stops, in the units of the task, [m] and [rad].
        iterations: N_up, most iterations of one period.
        one_step: Whether to apply the controller (27), (28) once to the measured pose; δ and N_up do not matter then,
            and the status is ``applied`` where J has full rank.
        horizon: n, the points that must be shown ahead.
        jacobians: ``"predicted"`` over the horizon, or ``"constant"``. One step knows no prediction yet.
        stop: Whose error is tested: that of the ``"horizon"`` (40), or of the ``"first_point"`` (16).

    Raises:
        InvalidInputError: A number is out of its range, or does not belong to the rule.
        UnknownNameError: There is no such rule, choice of Jacobians or stop.
    """

    rule: str = "condition"
    iterations: int = 10
    horizon: int = parameter(2, whole_number, at_least=1)
    jacobians: str = parameter("predicted", choice, available=("predicted", "constant"))
    stop: str = parameter("horizon", choice, available=("horizon", "first_point"))

    name: ClassVar[str] = "mfapc"
    step = mfapc_step

    @property
    def preview(self) -> int:
        """The n points that lie ahead."""
        return self.horizon

    def _horizon(self) -> tuple[int, bool, bool]:
        return self.horizon, self.jacobians == "predicted", self.stop == "horizon"
