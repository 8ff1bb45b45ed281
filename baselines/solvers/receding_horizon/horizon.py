"""Kernels of a receding horizon: cost and gradient over the joint velocities between its grid points.

A horizon of HL grid points has point 1 at the present, and HL - 1 free joint velocities (Varga 2021, section III).
"""

from __future__ import annotations

import numpy as np

from ikgym import cost_kernels, task_kernels
from ikgym.jit import kernel
from ikgym.kinematics import forward, forward_and_jacobian


@kernel
def horizon_cost(chain, kind, cost, dt, q, nominal, qdot):
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


@kernel
def difference_gradient(chain, kind, cost, dt, q, nominal, qdot, delta, gradient):
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


@kernel
def _roll(chain, kind, cost, dt, here, nominal, qdot, first, stages, scratch):
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


@kernel
def _scratch(kind, nominal):
    m = nominal.shape[1]
    return np.empty((3, 3)), np.empty(3), np.empty(m), np.empty(6 if kind == task_kernels.POSE else m)


@kernel
def analytic_gradient(chain, kind, cost, dt, q, nominal, qdot, gradient):
    """∂Φ/∂q̇ by the chain rule, and Φ; arguments as in :func:`difference_gradient`."""
    steps, n = qdot.shape
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    scratch = _gradient_scratch(kind, nominal, n)
    pull = np.empty((steps, n))
    here = q.copy()
    total = 0.0
    for i in range(steps):
        for j in range(n):
            here[j] += dt * qdot[i, j]
        forward_and_jacobian(chain, here, rotation, position, geometric)
        tracking = _tracking_gradient(kind, cost, nominal[i], rotation, position, geometric, pull[i], scratch)
        total += tracking + cost_kernels.velocity(cost, qdot[i])
        cost_kernels.velocity_gradient(cost, qdot[i], gradient[i])
    # A velocity moves all later grid points: sum their pulls from the end.
    for j in range(n):
        sum_of_pulls = 0.0
        for i in range(steps - 1, -1, -1):
            sum_of_pulls += pull[i, j]
            gradient[i, j] += dt * sum_of_pulls
    return total


@kernel
def analytic_state_gradient(chain, kind, cost, nominal, q, qdot, by_q, by_qdot):
    """∂Φ/∂q(2 … HL) and ∂Φ/∂q̇(1 … HL - 1) with states and velocities taken for independent, and Φ.

    Args:
        chain: The model of the arm.
        kind: The kind of task coordinates.
        cost: The cost's parameters.
        nominal: Nominal coordinates of the second and later grid points. Shape (at least HL - 1, m).
        q: Joint coordinates at the second and later grid points. Shape (HL - 1, n).
        qdot: Joint velocities. Shape (HL - 1, n).
        by_q: Receives ∂Φ/∂q. Shape (HL - 1, n).
        by_qdot: Receives ∂Φ/∂q̇. Shape (HL - 1, n).

    Returns:
        The cost.
    """
    steps, n = q.shape
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    scratch = _gradient_scratch(kind, nominal, n)
    total = 0.0
    for i in range(steps):
        forward_and_jacobian(chain, q[i], rotation, position, geometric)
        tracking = _tracking_gradient(kind, cost, nominal[i], rotation, position, geometric, by_q[i], scratch)
        total += tracking + cost_kernels.velocity(cost, qdot[i])
        cost_kernels.velocity_gradient(cost, qdot[i], by_qdot[i])
    return total


@kernel
def difference_state_gradient(chain, kind, cost, dt, nominal, q, qdot, delta, by_q, by_qdot):
    """:func:`analytic_state_gradient` by forward differences: ``delta`` in q̇, Δt ``delta`` in q.

    With these two a difference by a velocity in :func:`difference_gradient` is the sum of the differences by that
    velocity and by the states that it moves, but for rounding.
    """
    steps, n = q.shape
    rotation, position, pose, error = _scratch(kind, nominal)
    total = 0.0
    for i in range(steps):
        forward(chain, q[i], rotation, position)
        task_kernels.coordinates(kind, rotation, position, pose)
        task_kernels.error(kind, nominal[i], pose, error)
        tracking, velocity = cost_kernels.tracking(cost, error), cost_kernels.velocity(cost, qdot[i])
        total += tracking + velocity
        for j in range(n):
            kept = q[i, j]
            q[i, j] = kept + dt * delta
            forward(chain, q[i], rotation, position)
            task_kernels.coordinates(kind, rotation, position, pose)
            task_kernels.error(kind, nominal[i], pose, error)
            by_q[i, j] = (cost_kernels.tracking(cost, error) - tracking) / (dt * delta)
            q[i, j] = kept
            kept = qdot[i, j]
            qdot[i, j] = kept + delta
            by_qdot[i, j] = (cost_kernels.velocity(cost, qdot[i]) - velocity) / delta
            qdot[i, j] = kept
    return total


@kernel
def _gradient_scratch(kind, nominal, n):
    _, _, pose, error = _scratch(kind, nominal)
    e = error.shape[0]
    return pose, error, np.empty(e), np.empty((e, n)), np.empty((e, n))


@kernel
def _tracking_gradient(kind, cost, nominal, rotation, position, geometric, gradient, scratch):
    """Φ^X of one grid point, and its derivative by the joint coordinates there, which ``gradient`` (n,) receives."""
    pose, error, slope, jacobian, error_jacobian = scratch
    task_kernels.coordinates(kind, rotation, position, pose)
    task_kernels.error(kind, nominal, pose, error)
    task_kernels.jacobian(kind, rotation, geometric, jacobian)
    task_kernels.error_jacobian(kind, error, jacobian, error_jacobian)
    cost_kernels.tracking_gradient(cost, error, slope)
    for j in range(gradient.shape[0]):
        gradient[j] = 0.0
        for k in range(error.shape[0]):
            gradient[j] += slope[k] * error_jacobian[k, j]
    return cost_kernels.tracking(cost, error)
