"""Kernel: the adjoint of a segment, step by step backwards, with exact kinematic Jacobians.

λ is the gradient of the loss with respect to the joint coordinates after a step, μ that with respect to the velocities
applied in it; both are propagated back through the stops, the limits of acceleration and velocity, the bilinear law and
the error of the task. At a limit the gradient with respect to the command is 0; with respect to the last velocity it is
that of the applied one where the acceleration is at its limit, and with respect to the last coordinate −1/Δt where the
joint comes to rest at a stop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.agents.bilinear.kernels import joint_command
from baselines.solvers.receding_horizon.newton.workspace import knot_workspace
from ikgym.kernels import cost as cost_kernels
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.cost import P_X_INSIDE
from ikgym.kernels.jit import inlined, kernel, uncounted
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.kernels.limits import CHANGE, FASTEST, LOWER, UPPER, clip
from ikgym.rl.twists import (
    error_gradient,
    error_kind,
    is_turned,
    turn,
    turn_gradient,
    twist,
    twist_size,
)

Floats = npt.NDArray[np.float64]


class Gradient(NamedTuple):
    """The gradient of a number with respect to the input of a segment.

    Attributes:
        q: With respect to the joint coordinates; at first to those after the segment. Shape (N, n).
        qdot: With respect to the joint velocities applied before it; likewise. Shape (N, n).
        output: With respect to (G, h). Shape (N, n (w + 1)).
    """

    q: Floats
    qdot: Floats
    output: Floats


@kernel
def adjoint(model, rows, output, path, by_cost, gradient, start, stop):
    """Propagates gradients back through a segment.

    Args:
        model: As in the segment.
        rows: The input of the segment.
        output: As in the segment.
        path: The result of the segment.
        by_cost: The gradient with respect to the cost of each arm. Shape (N,).
        gradient: A :class:`Gradient`; changed in place.
        start: The first row.
        stop: The row after the last.
    """
    chain, kind, cost, dt, velocity_limit, limits = model
    nominal, counted, steps, speed = rows
    q_path, qdot_path = path[:2]
    by_q, by_qdot, by_output = gradient
    prismatic, axis, m, n = chain.prismatic, chain.axes[0], nominal.shape[2], q_path.shape[2]
    turned, w, of_twist = is_turned(kind, prismatic), twist_size(kind), error_kind(kind)
    e = task_kernels.error_size(kind, m)
    size = 5 if kind == task_kernels.AXIS else w
    place = knot_workspace(kind, m, n)
    pose = place.pose
    error, by_error, due, by_due = np.empty(max(e, 6)), np.empty(max(e, 6)), np.empty(w), np.empty(w)
    for row in range(start, stop):
        lambda_, mu, into = by_q[row], by_qdot[row], by_output[row]
        into[:] = 0.0
        fill_kinematics(chain, kind, q_path[row, steps[row]], place)
        for t in range(steps[row] - 1, -1, -1):
            target, weight = nominal[row, t], by_cost[row] if counted[row, t] else 0.0
            q, last, reached, applied = q_path[row, t], qdot_path[row, t], q_path[row, t + 1], qdot_path[row, t + 1]
            if weight != 0.0:
                task_kernels.error(kind, target, pose, error[:e])
                for a in range(e):
                    by_error[a] = weight * cost_kernels.gradient(error[a], cost.delta_x, P_X_INSIDE, cost.p_x)
                for j in range(n):
                    mu[j] += weight * cost_kernels.gradient(applied[j], cost.delta_qdot, cost.p_in, cost.p_out)
                add_error_gradient(kind, target, place, error[:e], by_error[:e], lambda_)
            fill_kinematics(chain, kind, q, place)
            twist(kind, target, pose, error, due)
            if turned:
                turn(axis, -q[0], due)
            by_due[:] = 0.0
            for j in range(n):
                command = joint_command(output[row], j, due, speed[row], dt)
                move, by = (last[j], q[j], reached[j]), (lambda_[j], mu[j])
                by_command, lambda_[j], mu[j] = limits_gradient(limits, velocity_limit, j, command, move, by, dt)
                add_law_gradient(output[row], j, by_command, due, speed[row], dt, into, by_due)
            if turned:
                lambda_[0] += turn_gradient(axis, due, by_due)
                turn(axis, q[0], by_due)
            error_gradient(kind, target, by_due, by_error[:size])
            task_kernels.error(of_twist, target, pose, error[:size])
            add_error_gradient(of_twist, target, place, error[:size], by_error[:size], lambda_)


@uncounted
def fill_kinematics(chain, kind, q, place):
    """Fills a :class:`KnotWorkspace` with frame, geometric Jacobian and pose at joint coordinates of shape (n,)."""
    forward_and_jacobian(chain, q, place.rotation, place.position, place.geometric)
    task_kernels.coordinates(kind, place.rotation, place.position, place.pose)


@uncounted
def add_error_gradient(kind, target, place, error, by_error, lambda_):
    """Adds the gradient through the error of the task to that with respect to the joint coordinates.

    Args:
        kind: Of task coordinates.
        target: Reference task coordinates. Shape (m,).
        place: A :class:`KnotWorkspace`, see :func:`fill_kinematics`.
        error: Of the task. Shape (e,).
        by_error: The gradient with respect to it. Shape (e,).
        lambda_: That with respect to the joint coordinates. Shape (n,).
    """
    e = error.shape[0]
    task_jacobian, jacobian = place.jacobian[:e], place.error_jacobian[:e]
    task_kernels.jacobian(kind, place.rotation, place.geometric, task_jacobian)
    task_kernels.error_jacobian(kind, target, place.pose, error, task_jacobian, jacobian)
    for a in range(e):
        for j in range(lambda_.shape[0]):
            lambda_[j] += by_error[a] * jacobian[a, j]


@inlined
def add_law_gradient(output, j, by_command, due, speed, dt, into, by_due):
    """Adds the gradient through the command of a joint to those with respect to (G, h) and the twist that is due.

    Args:
        output: (G, h). Shape (n (w + 1),).
        j: The joint.
        by_command: The gradient with respect to its command.
        due: The twist. Shape (w,).
        speed: s.
        dt: Δt in [s].
        into: The gradient with respect to (G, h). Shape (n (w + 1),).
        by_due: The gradient with respect to the twist. Shape (w,).
    """
    w, scaled = due.shape[0], by_command / dt
    first = j * (w + 1)
    for a in range(w):
        into[first + a] += scaled * due[a]
        by_due[a] += scaled * output[first + a]
    into[first + w] += by_command * speed


@inlined
def limits_gradient(limits, velocity_limit, j, command, move, by, dt):
    """Propagates the gradients of joint ``j`` back through the limits of :func:`ikgym.plant.step.step`.

    Args:
        limits: See :class:`baselines.policy_kernels.Model`. Shape (6, n).
        velocity_limit: Shape (n,).
        j: The joint.
        command: The command in [rad/s] or [m/s].
        move: The velocity applied in the step before; the coordinate before this step in [rad] or [m], and after it.
        by: The gradients with respect to the coordinate after the step, and to the velocity applied in it.
        dt: Δt in [s].

    Returns:
        The gradients with respect to the command, the coordinate before, and the velocity before.
    """
    last, here, reached = move
    lambda_, mu = by
    by_last, passes = 0.0, abs(command) <= velocity_limit[j]
    allowed = clip(command, velocity_limit[j])
    passes = passes and abs(allowed) <= limits[FASTEST, j]
    allowed = clip(allowed, limits[FASTEST, j])
    accelerates = abs(allowed - last) <= limits[CHANGE, j]
    velocity = allowed if accelerates else last + clip(allowed - last, limits[CHANGE, j])
    if not limits[LOWER, j] <= here + dt * velocity <= limits[UPPER, j]:
        at_rest = abs(reached - here) / dt <= limits[FASTEST, j]
        return 0.0, (-mu / dt if at_rest else 0.0), by_last
    by_velocity = dt * lambda_ + mu
    if not accelerates:
        return 0.0, lambda_, by_velocity
    return (by_velocity if passes else 0.0), lambda_, by_last
