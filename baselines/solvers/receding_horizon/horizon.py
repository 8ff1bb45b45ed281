"""Kernels of a receding horizon: cost and gradient over the joint velocities between its grid points.

A horizon of HL grid points has point 1 at the present, and HL - 1 free joint velocities (Varga 2021, section III).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy_kernels import Model
from baselines.solvers.receding_horizon.newton.workspace import knot_workspace
from ikgym.kernels import cost as cost_kernels
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inlined, inner, kernel
from ikgym.kernels.kinematics import forward, forward_and_jacobian

Floats = npt.NDArray[np.float64]


class HorizonModel(NamedTuple):
    """The model that all kernels see, and the weights of its joints.

    Attributes:
        model: See :class:`baselines.policy_kernels.Model`.
        joint_weights: Factors of the velocity costs of the joints. Shape (n,).
    """

    model: Model
    joint_weights: Floats


@kernel
def velocity_cost(data, qdot):
    """Φ^U of one step with the weights of a :class:`HorizonModel`. Shape of ``qdot`` (n,)."""
    cost, weights, total = data.model.cost, data.joint_weights, 0.0
    for j in range(qdot.shape[0]):
        total += weights[j] * cost_kernels.value(qdot[j], cost.delta_qdot, cost.p_in, cost.p_out)
    return total


@kernel
def velocity_gradient(data, qdot, out):
    """Its derivative by q̇. Shapes (n,)."""
    cost, weights = data.model.cost, data.joint_weights
    for j in range(qdot.shape[0]):
        out[j] = weights[j] * cost_kernels.gradient(qdot[j], cost.delta_qdot, cost.p_in, cost.p_out)


@inner
def difference_gradient(data, q, nominal, qdot, delta, gradient):
    """∂Φ/∂q̇ by forward differences (Varga 2021, section IV), and Φ, the sum of the stage costs over the horizon.

    Args:
        data: The :class:`HorizonModel`; limits do not count.
        q: Joint coordinates at the first grid point. Shape (n,).
        nominal: Nominal coordinates of the second and later grid points. Shape (at least HL - 1, m).
        qdot: Joint velocities, put back as they were. Shape (HL - 1, n).
        delta: The difference.
        gradient: Receives the gradient. Shape (HL - 1, n).

    Returns:
        The cost.
    """
    steps, n = qdot.shape
    workspace = frame_workspace(data.model.kind, nominal)
    stages, shifted = np.empty(steps), np.empty(steps)
    total = _roll(data, q.copy(), nominal, qdot, 0, stages, workspace)
    start, here = q.copy(), np.empty(n)
    before = 0.0
    for i in range(steps):
        for j in range(n):
            kept = qdot[i, j]
            qdot[i, j] = kept + delta
            here[:] = start
            # The stages before the i-th are as they were.
            moved = before + _roll(data, here, nominal, qdot, i, shifted, workspace)
            gradient[i, j] = (moved - total) / delta
            qdot[i, j] = kept
        for j in range(n):
            start[j] += data.model.dt * qdot[i, j]
        before += stages[i]
    return total


@inner
def _roll(data, here, nominal, qdot, first, stages, workspace):
    """Goes from ``here`` through the stages from ``first`` on, and sums their costs, which ``stages`` receives."""
    cost, error, total = data.model.cost, workspace[3], 0.0
    for i in range(first, qdot.shape[0]):
        for j in range(here.shape[0]):
            here[j] += data.model.dt * qdot[i, j]  # eq. 5
        tracking_error(data, nominal[i], here, workspace, error)
        stages[i] = cost_kernels.tracking(cost, error) + velocity_cost(data, qdot[i])
        total += stages[i]
    return total


@inlined
def tracking_error(data, nominal, q, workspace, error):
    """The tracking error of one grid point: shapes (m,), (n,), a :func:`frame_workspace`, (e,)."""
    rotation, position, pose, _ = workspace
    forward(data.model.chain, q, rotation, position)
    task_kernels.coordinates(data.model.kind, rotation, position, pose)
    task_kernels.error(data.model.kind, nominal, pose, error)


@inner
def frame_workspace(kind, nominal):
    """Orientation (3, 3), position (3,), task coordinates (m,) and error (e,) of a grid point."""
    m = nominal.shape[1]
    return np.empty((3, 3)), np.empty(3), np.empty(m), np.empty(task_kernels.error_size(kind, m))


@inner
def analytic_gradient(data, q, nominal, qdot, gradient):
    """∂Φ/∂q̇ by the chain rule, and Φ; arguments as in :func:`difference_gradient`."""
    (steps, n), dt = qdot.shape, data.model.dt
    states, by_q = np.empty((steps, n)), np.empty((steps, n))
    roll_out(dt, q, qdot, states)
    total = analytic_state_gradient(data, nominal, states, qdot, by_q, gradient)
    # A velocity moves all later grid points: sum their derivatives from the end.
    for j in range(n):
        sum_from_end = 0.0
        for i in range(steps - 1, -1, -1):
            sum_from_end += by_q[i, j]
            gradient[i, j] += dt * sum_from_end
    return total


@inlined
def roll_out(dt, q, qdot, states):
    """The joint coordinates at the second and later grid points (eq. 5): a number, (n,), (HL - 1, n), (HL - 1, n)."""
    for i in range(qdot.shape[0]):
        for j in range(q.shape[0]):
            states[i, j] = (states[i - 1, j] if i > 0 else q[j]) + dt * qdot[i, j]


@inner
def analytic_state_gradient(data, nominal, q, qdot, by_q, by_qdot):
    """∂Φ/∂q(2 … HL) and ∂Φ/∂q̇(1 … HL - 1) with states and velocities taken for independent, and Φ.

    ``q`` are the joint coordinates at the second and later grid points; all arrays have the shape (HL - 1, n).
    """
    steps, n = q.shape
    chain, workspace = data.model.chain, knot_workspace(data.model.kind, nominal.shape[1], n)
    rotation, position, geometric = workspace.rotation, workspace.position, workspace.geometric
    total = 0.0
    for i in range(steps):
        forward_and_jacobian(chain, q[i], rotation, position, geometric)
        tracking = _tracking_gradient(data, nominal[i], workspace, by_q[i])
        total += tracking + velocity_cost(data, qdot[i])
        velocity_gradient(data, qdot[i], by_qdot[i])
    return total


@inner
def difference_state_gradient(data, nominal, q, qdot, delta, by_q, by_qdot):
    """:func:`analytic_state_gradient` by forward differences: ``delta`` in q̇, Δt ``delta`` in q.

    With these two a difference by a velocity in :func:`difference_gradient` is the sum of the differences by that
    velocity and by the states that it moves, up to rounding.
    """
    steps, n = q.shape
    cost, dt, workspace, total = data.model.cost, data.model.dt, frame_workspace(data.model.kind, nominal), 0.0
    error = workspace[3]
    for i in range(steps):
        tracking_error(data, nominal[i], q[i], workspace, error)
        tracking, velocity = cost_kernels.tracking(cost, error), velocity_cost(data, qdot[i])
        total += tracking + velocity
        for j in range(n):
            kept = q[i, j]
            q[i, j] = kept + dt * delta
            tracking_error(data, nominal[i], q[i], workspace, error)
            by_q[i, j] = (cost_kernels.tracking(cost, error) - tracking) / (dt * delta)
            q[i, j] = kept
            kept = qdot[i, j]
            qdot[i, j] = kept + delta
            by_qdot[i, j] = (velocity_cost(data, qdot[i]) - velocity) / delta
            qdot[i, j] = kept
    return total


@kernel
def linearise(kind, nominal, workspace):
    """Task coordinates, their error and its derivative by the joint coordinates, of the frame and geometric Jacobian.

    They are arrays of a :class:`newton.workspace.KnotWorkspace`, changed in place.
    """
    task_kernels.coordinates(kind, workspace.rotation, workspace.position, workspace.pose)
    task_kernels.error(kind, nominal, workspace.pose, workspace.error)
    task_kernels.jacobian(kind, workspace.rotation, workspace.geometric, workspace.jacobian)
    task_kernels.error_jacobian(
        kind, nominal, workspace.pose, workspace.error, workspace.jacobian, workspace.error_jacobian
    )


@inner
def _tracking_gradient(data, nominal, workspace, gradient):
    """Φ^X of one grid point, and its derivative by the joint coordinates there, which ``gradient`` (n,) receives."""
    error, by_error, error_jacobian = workspace.error, workspace.gradient, workspace.error_jacobian
    linearise(data.model.kind, nominal, workspace)
    cost_kernels.tracking_gradient(data.model.cost, error, by_error)
    for j in range(gradient.shape[0]):
        gradient[j] = 0.0
        for k in range(error.shape[0]):
            gradient[j] += by_error[k] * error_jacobian[k, j]
    return cost_kernels.tracking(data.model.cost, error)
