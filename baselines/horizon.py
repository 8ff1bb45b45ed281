"""Kernels of a receding horizon: cost and gradient over the joint velocities between its grid points.

A horizon of HL grid points has point 1 at the present, and HL - 1 free joint velocities (Varga 2021, section III).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ikgym import cost_kernels, task_kernels
from ikgym.kinematics import forward, forward_and_jacobian


@njit(cache=True, nogil=True)
def horizon_cost(chain, kind, cost, dt, q, nominal, qdot):  # type: ignore[no-untyped-def]
    """Φ, the sum of the stage costs over the horizon.

    Args:
        chain: The model of the arm.
        kind: The kind of task coordinates.
        cost: The :class:`ikgym.cost_kernels.CostParameters`.
        dt: Δt in [s].
        q: Joint coordinates at the first grid point. Shape (n,).
        nominal: Nominal coordinates of the second and later grid points. Shape (at least HL - 1, m).
        qdot: Joint velocities. Shape (HL - 1, n).

    Returns:
        The cost.
    """
    stages = np.empty(qdot.shape[0])
    return _roll(chain, kind, cost, dt, q.copy(), nominal, qdot, 0, stages, _scratch(kind, nominal))


@njit(cache=True, nogil=True)
def difference_gradient(chain, kind, cost, dt, q, nominal, qdot, delta, gradient):  # type: ignore[no-untyped-def]
    """∂Φ/∂q̇ by forward differences of ``delta`` (Varga 2021, section IV), and Φ; arguments as above.

    Args:
        chain: The model of the arm.
        kind: The kind of task coordinates.
        cost: The cost's parameters.
        dt: Δt in [s].
        q: Joint coordinates at the first grid point. Shape (n,).
        nominal: Nominal coordinates ahead. Shape (at least HL - 1, m).
        qdot: Joint velocities, put back as they were. Shape (HL - 1, n).
        delta: The difference, in [rad/s] or [m/s].
        gradient: Receives the gradient. Shape (HL - 1, n).

    Returns:
        The cost.
    """
    steps, n = qdot.shape
    scratch = _scratch(kind, nominal)
    stages, shifted = np.empty(steps), np.empty(steps)
    total = _roll(chain, kind, cost, dt, q.copy(), nominal, qdot, 0, stages, scratch)
    start, here = q.copy(), np.empty(n)
    before = 0.0
    for i in range(steps):
        for j in range(n):
            kept = qdot[i, j]
            qdot[i, j] = kept + delta
            here[:] = start
            # The stages before the i-th are as they were.
            moved = before + _roll(chain, kind, cost, dt, here, nominal, qdot, i, shifted, scratch)
            gradient[i, j] = (moved - total) / delta
            qdot[i, j] = kept
        for j in range(n):
            start[j] += dt * qdot[i, j]
        before += stages[i]
    return total


@njit(cache=True, nogil=True)
def _roll(chain, kind, cost, dt, here, nominal, qdot, first, stages, scratch):  # type: ignore[no-untyped-def]
    """Goes from ``here`` through the stages from ``first`` on, and sums their costs, which ``stages`` receives."""
    rotation, position, pose, error = scratch
    total = 0.0
    for i in range(first, qdot.shape[0]):
        for j in range(here.shape[0]):
            here[j] += dt * qdot[i, j]  # eq. 5
        forward(chain, here, rotation, position)
        task_kernels.coordinates(kind, rotation, position, pose)
        task_kernels.error(kind, nominal[i], pose, error)
        stages[i] = cost_kernels.tracking(cost, error) + cost_kernels.velocity(cost, qdot[i])
        total += stages[i]
    return total


@njit(cache=True, nogil=True)
def _scratch(kind, nominal):  # type: ignore[no-untyped-def]
    m = nominal.shape[1]
    return np.empty((3, 3)), np.empty(3), np.empty(m), np.empty(6 if kind == task_kernels.POSE else m)


@njit(cache=True, nogil=True)
def analytic_gradient(chain, kind, cost, dt, q, nominal, qdot, gradient):  # type: ignore[no-untyped-def]
    """∂Φ/∂q̇ by the chain rule, and Φ; arguments as in :func:`difference_gradient`."""
    steps, n = qdot.shape
    rotation, position, pose, error = _scratch(kind, nominal)
    e = error.shape[0]
    slope, geometric = np.empty(e), np.empty((6, n))
    jacobian, error_jacobian = np.empty((e, n)), np.empty((e, n))
    pull = np.empty((steps, n))
    here = q.copy()
    total = 0.0
    for i in range(steps):
        for j in range(n):
            here[j] += dt * qdot[i, j]
        forward_and_jacobian(chain, here, rotation, position, geometric)
        task_kernels.coordinates(kind, rotation, position, pose)
        task_kernels.error(kind, nominal[i], pose, error)
        task_kernels.jacobian(kind, rotation, geometric, jacobian)
        task_kernels.error_jacobian(kind, error, jacobian, error_jacobian)
        total += cost_kernels.tracking(cost, error) + cost_kernels.velocity(cost, qdot[i])
        cost_kernels.tracking_gradient(cost, error, slope)
        cost_kernels.velocity_gradient(cost, qdot[i], gradient[i])
        for j in range(n):
            pull[i, j] = 0.0
            for k in range(e):
                pull[i, j] += slope[k] * error_jacobian[k, j]
    # A velocity moves all later grid points: sum their pulls from the end.
    for j in range(n):
        sum_of_pulls = 0.0
        for i in range(steps - 1, -1, -1):
            sum_of_pulls += pull[i, j]
            gradient[i, j] += dt * sum_of_pulls
    return total
