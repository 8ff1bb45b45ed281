"""Kernel: the adjoint of a segment, step by step backwards, with exact kinematic Jacobians.

With λ the gradient of the loss by the joint coordinates after a step, and μ that by the velocities applied in it, both
are led back through the stops, the limits of acceleration and velocity, the bilinear law and the error of the task.
What a limit holds back has the gradient of what is left: none by the command, that by the last velocity where the
acceleration is at its limit, and −1/Δt by where the joint was where it comes to stand at a stop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.agents.bilinear.twists import (
    error_gradient,
    error_kind,
    is_turned,
    turn,
    turn_gradient,
    twist,
    twist_size,
)
from baselines.training.gradients.segment import commanded
from ikgym import cost_kernels, task_kernels
from ikgym.jit import inlined, kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.limit_kernels import CHANGE, FASTEST, LOWER, UPPER, within

Floats = npt.NDArray[np.float64]


class Gradient(NamedTuple):
    """The gradient of a number by what a segment begins with.

    Attributes:
        q: By the joint coordinates; that by those after the segment at first. Shape (N, n).
        qdot: By the joint velocities applied before it; likewise. Shape (N, n).
        output: By (G, h). Shape (N, n (w + 1)).
    """

    q: Floats
    qdot: Floats
    output: Floats


@kernel
def adjoint(task, rows, output, path, by_loss, gradient, start, stop):
    """Leads gradients back through a segment.

    Args:
        task: A :class:`baselines.training.gradients.segment.Task`.
        rows: What the segment was given; `spent`, `played` and `usual` are not looked at.
        output: As in the segment.
        path: What the segment made of it.
        by_loss: The gradient by the loss of each arm; weights count as constants. Shape (N,).
        gradient: A :class:`Gradient`; changed in place.
        start: The first row that is meant.
        stop: The row after the last.
    """
    chain, kind, e, dt, velocity_limit, limits, cost = task
    nominal, _, steps, speed = rows[:4]
    q_path, qdot_path, weights = path[:3]
    by_q, by_qdot, by_output = gradient
    prismatic, axis, m, n = chain.prismatic, chain.axes[0], nominal.shape[2], q_path.shape[2]
    turned, w, of_twist = is_turned(kind, prismatic), twist_size(kind), error_kind(kind)
    size = 5 if kind == task_kernels.AXIS else w
    rotation, position, pose = np.empty((3, 3)), np.empty(3), np.empty(m)
    geometric, task_jacobian, jacobian = np.empty((6, n)), np.empty((max(e, 6), n)), np.empty((max(e, 6), n))
    error, by_error, due, by_due = np.empty(max(e, 6)), np.empty(max(e, 6)), np.empty(w), np.empty(w)
    for row in range(start, stop):
        lambda_, mu, into = by_q[row], by_qdot[row], by_output[row]
        into[:] = 0.0
        forward_and_jacobian(chain, q_path[row, steps[row]], rotation, position, geometric)
        for t in range(steps[row] - 1, -1, -1):
            target, weight = nominal[row, t], weights[row, t] * by_loss[row]
            q, last, reached, applied = q_path[row, t], qdot_path[row, t], q_path[row, t + 1], qdot_path[row, t + 1]
            # The stage cost.
            if weight != 0.0:
                task_kernels.coordinates(kind, rotation, position, pose)
                task_kernels.error(kind, target, pose, error[:e])
                cost_kernels.tracking_gradient(cost, error[:e], by_error[:e])
                task_kernels.jacobian(kind, rotation, geometric, task_jacobian[:e])
                task_kernels.error_jacobian(kind, target, pose, error[:e], task_jacobian[:e], jacobian[:e])
                add_product(jacobian[:e], by_error[:e], weight, lambda_)
                for j in range(n):
                    mu[j] += weight * cost_kernels.gradient(applied[j], cost.delta_qdot, cost.p_in, cost.p_out)
            # The law, and what limits make of it.
            forward_and_jacobian(chain, q, rotation, position, geometric)
            task_kernels.coordinates(kind, rotation, position, pose)
            twist(kind, target, pose, error[:6], due)
            if turned:
                turn(axis, -q[0], due)
            by_due[:] = 0.0
            for j in range(n):
                asked = commanded(output[row], j, due, speed[row], dt)
                move, by = (last[j], q[j], reached[j]), (lambda_[j], mu[j])
                by_asked, lambda_[j], mu[j] = unlimited(limits, velocity_limit, j, asked, move, by, dt)
                own, of_output = j * (w + 1), by_asked / dt
                for a in range(w):
                    into[own + a] += of_output * due[a]
                    by_due[a] += of_output * output[row, own + a]
                into[own + w] += by_asked * speed[row]
            # The twist that is due.
            if turned:
                lambda_[0] += turn_gradient(axis, due, by_due)
                turn(axis, q[0], by_due)
            error_gradient(kind, target, by_due, by_error[:size])
            task_kernels.error(of_twist, target, pose, error[:size])
            task_kernels.jacobian(of_twist, rotation, geometric, task_jacobian[:size])
            task_kernels.error_jacobian(of_twist, target, pose, error[:size], task_jacobian[:size], jacobian[:size])
            add_product(jacobian[:size], by_error[:size], 1.0, lambda_)


@inlined
def unlimited(limits, velocity_limit, j, asked, move, by, dt):
    """Leads the gradients of joint ``j`` back through what :func:`ikgym.simulation.step` does to a command.

    Args:
        limits: Shape (4, n), or (0, n).
        velocity_limit: Shape (n,).
        j: The joint.
        asked: The command in [rad/s] or [m/s].
        move: The velocity applied in the step before; the coordinate before this step in [rad] or [m], and after it.
        by: The gradients by the coordinate after the step, and by the velocity applied in it.
        dt: Δt in [s].

    Returns:
        The gradients by the command, by the coordinate before, and by the velocity before.
    """
    last, here, reached = move
    lambda_, mu = by
    by_last, passes = 0.0, abs(asked) <= velocity_limit[j]
    if limits.shape[0] == 0:
        return (dt * lambda_ + mu if passes else 0.0), lambda_, by_last
    allowed = within(asked, velocity_limit[j])
    passes = passes and abs(allowed) <= limits[FASTEST, j]
    allowed = within(allowed, limits[FASTEST, j])
    accelerates = abs(allowed - last) <= limits[CHANGE, j]
    velocity = allowed if accelerates else last + within(allowed - last, limits[CHANGE, j])
    if not limits[LOWER, j] <= here + dt * velocity <= limits[UPPER, j]:
        stands = abs(reached - here) / dt <= limits[FASTEST, j]
        return 0.0, (-mu / dt if stands else 0.0), by_last
    by_velocity = dt * lambda_ + mu
    if not accelerates:
        return 0.0, lambda_, by_velocity
    return (by_velocity if passes else 0.0), lambda_, by_last


@inlined
def add_product(jacobian, by_error, factor, out):
    """``out += factor · Jᵀ g``: shapes (e, n), (e,), (n,)."""
    for a in range(jacobian.shape[0]):
        value = factor * by_error[a]
        for j in range(out.shape[0]):
            out[j] += value * jacobian[a, j]
