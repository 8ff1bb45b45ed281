"""The kernel of the fixed-point transformation: the iterations of one step (Faitli 2018, eq. 1; Khan 2020, eq. 2.8)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from baselines.status import Status
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.kinematics import forward, forward_and_jacobian
from ikgym.kernels.linear_algebra import dot
from ikgym.validation import FloatArray

#: Transformations of f(q) - x before it is added to q, with their numbers in the kernel.
TRANSFORMATIONS = {"transpose": 0, "none": 1, "sign": 2, "sign_by_growth": 3}
_TRANSPOSE, _SIGN, _BY_GROWTH = (TRANSFORMATIONS[name] for name in ("transpose", "sign", "sign_by_growth"))
_CONVERGED, _LIMIT, _DIVERGED = int(Status.CONVERGED), int(Status.ITERATION_LIMIT), int(Status.DIVERGED)


class FixedPointMemory(NamedTuple):
    """Memory of the sign variants: the last iteration of the previous step.

    Attributes:
        previous: With ``"sign"`` f - x, zero where there was none; with ``"sign_by_growth"`` σ and ‖f - x‖, infinite
            where there was none; else of no columns. Shape (B, n), (B, 2) or (B, 0).
    """

    previous: FloatArray


@kernel
def fixed_point_step(model, numbers, batch, solution):
    """The iterations of one step, row by row; see :class:`CompiledPolicy` for the arguments."""
    chain, kind, dt = model.chain, model.kind, model.dt
    transformation, corrected_by, weights = numbers.code, numbers.corrected_by, numbers.weights
    iterations, tolerance = numbers.iterations, numbers.tolerance
    starts, nominal, previous = batch.q, batch.nominal, solution.memory.previous
    q, _, status, made = solution
    n, m = q.shape[1], nominal.shape[2]
    e = task_kernels.error_size(kind, m)
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    error, jacobian, h, weighted, pose = np.empty(e), np.empty((e, n)), np.empty(n), np.empty(e), np.empty(m)
    for row in range(q.shape[0]):
        start, here, target = starts[row], q[row], nominal[row, 0]
        for j in range(n):
            here[j] = start[j]
        made[row] = iterations
        first = residual = 0.0
        for step in range(iterations + 1):
            last = step == iterations
            if last or transformation != _TRANSPOSE:
                forward(chain, here, rotation, position)
            else:
                forward_and_jacobian(chain, here, rotation, position, geometric)
                task_kernels.jacobian(kind, rotation, geometric, jacobian)
            task_kernels.coordinates(kind, rotation, position, pose)
            task_kernels.error(kind, target, pose, error)
            h[:] = 0.0
            if transformation == _TRANSPOSE:
                for i in range(e):
                    weighted[i] = weights[i] * error[i]
                _add_transposed(jacobian, weighted, h)
            else:
                for j in range(n):
                    h[j] = -error[corrected_by[j]]
            residual = math.sqrt(dot(error, error))
            if step == 0:
                first = residual
            if last:
                break
            if transformation == _SIGN:
                _keep_direction(h, previous[row])
            elif transformation == _BY_GROWTH:
                _turn_where_grown(h, previous[row])
            _contract(numbers.slope, numbers.d, numbers.fixed_point, numbers.factor, h, here)
        status[row] = _CONVERGED if residual <= tolerance else _LIMIT
        # Further off than at the start, and further away than the drives can go.
        if not residual <= first:
            for j in range(n):
                if not abs(here[j] - start[j]) <= model.velocity_limit[j] * dt:
                    status[row] = _DIVERGED
        for j in range(n):
            here[j] = ((start[j] if status[row] == _DIVERGED else here[j]) - start[j]) / dt
        if status[row] == _DIVERGED:
            if transformation == _SIGN:
                previous[row] = 0.0
            elif transformation == _BY_GROWTH:
                previous[row, 1] = math.inf


@inner
def _contract(slope, d, fixed_point, a, h, q):
    """Eq. 1 with F(ξ) = slope · ξ + D and its fixed point ξ*; where h = 0 its limit, which is to stay."""
    norm = math.sqrt(dot(h, h))
    if norm == 0.0:
        return
    amount = slope * (a * norm + fixed_point) + d - fixed_point
    for j in range(q.shape[0]):
        q[j] += amount * (h[j] / norm)


@inner
def _add_transposed(jacobian, missing, h):
    """Adds Jᵀ (f - x) to h, with ``missing`` = x - f of shape (e,)."""
    for i in range(jacobian.shape[0]):
        for j in range(jacobian.shape[1]):
            h[j] -= jacobian[i, j] * missing[i]


@inner
def _keep_direction(h, previous):
    """Khan 2020, eq. 2.8: turns h about where it points away from the one before, which it then replaces."""
    sign = -1.0 if dot(h, previous) < 0.0 else 1.0
    for j in range(h.shape[0]):
        previous[j] = h[j]
        h[j] *= sign


@inner
def _turn_where_grown(h, previous):
    """The other reading of eq. 2.8: σ changes where ‖h‖ has grown; both are remembered."""
    length = math.sqrt(dot(h, h))
    if length > previous[1]:
        previous[0] = -previous[0]
    previous[1] = length
    for j in range(h.shape[0]):
        h[j] *= previous[0]
