"""Kernels of twists: the motion from a pose to a reference pose, as vectors that turn with the base frame."""

from __future__ import annotations

import math

from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.axes import across
from ikgym.kernels.jit import inlined, inner, kernel


@inlined
def error_kind(kind):
    """The kind of task whose error gives the twist: full rotations are compared by their rotation vector."""
    return task_kernels.POSE if kind == task_kernels.MATRIX else kind


@kernel
def twist_size(kind):
    """w, the components of a twist."""
    return 3 if kind == task_kernels.POSITION else 6


@kernel
def is_turned(kind, prismatic):
    """Whether twists are expressed in the frame of joint 1, which makes them independent of its angle.

    A prismatic joint 1 turns nothing, and skew coordinates are no vector that could be turned.
    """
    return kind != task_kernels.SKEW and not prismatic[0]


@kernel
def twist(kind, nominal, coordinates, error, out):
    """The motion from one pose to another.

    Args:
        kind: Of task coordinates, see :mod:`ikgym.kernels.tasks`.
        nominal: The other one's coordinates. Shape (m,).
        coordinates: Those of the first. Shape (m,).
        error: Scratch. Shape (6,).
        out: Receives the position error in [m], then the rotation vector in [rad] in the base frame; for SKEW the
            error of the coordinates. Shape (w,).
    """
    if kind == task_kernels.AXIS:
        task_kernels.error(kind, nominal, coordinates, error[:5])
        ux, uy, uz, vx, vy, vz = across(nominal[0], nominal[1], nominal[2])
        for i in range(3):
            out[i] = error[i]
        out[3] = ux * error[3] + vx * error[4]
        out[4] = uy * error[3] + vy * error[4]
        out[5] = uz * error[3] + vz * error[4]
    else:
        task_kernels.error(error_kind(kind), nominal, coordinates, out)


@inner
def error_gradient(kind, nominal, gradient, out):
    """From the gradient by a twist to that by the error of the task that it is made of.

    Args:
        kind: As in :func:`twist`.
        nominal: As in :func:`twist`.
        gradient: By the twist. Shape (w,).
        out: Receives that by the error. Shape (5,) for AXIS, else (w,).
    """
    if kind == task_kernels.AXIS:
        ux, uy, uz, vx, vy, vz = across(nominal[0], nominal[1], nominal[2])
        for i in range(3):
            out[i] = gradient[i]
        out[3] = ux * gradient[3] + uy * gradient[4] + uz * gradient[5]
        out[4] = vx * gradient[3] + vy * gradient[4] + vz * gradient[5]
    else:
        for i in range(out.shape[0]):
            out[i] = gradient[i]


@kernel
def turn(axis, angle, vectors):
    """Turns the one or two vectors of a twist about a unit axis by an angle, in place. Shapes (3,), (w,)."""
    c, s = math.cos(angle), math.sin(angle)
    ax, ay, az = axis[0], axis[1], axis[2]
    for i in range(0, vectors.shape[0], 3):
        x, y, z = vectors[i], vectors[i + 1], vectors[i + 2]
        along = (1.0 - c) * (ax * x + ay * y + az * z)
        vectors[i] = c * x + s * (ay * z - az * y) + along * ax
        vectors[i + 1] = c * y + s * (az * x - ax * z) + along * ay
        vectors[i + 2] = c * z + s * (ax * y - ay * x) + along * az


@inner
def turn_gradient(axis, turned, gradient):
    """The derivative of a function of ``turn(axis, -angle, …)`` by the angle.

    Args:
        axis: Unit vector. Shape (3,).
        turned: The twist after the turn. Shape (w,).
        gradient: Of the function by it. Shape (w,).
    """
    ax, ay, az = axis[0], axis[1], axis[2]
    total = 0.0
    for i in range(0, turned.shape[0], 3):
        x, y, z = turned[i], turned[i + 1], turned[i + 2]
        total -= gradient[i] * (ay * z - az * y)
        total -= gradient[i + 1] * (az * x - ax * z)
        total -= gradient[i + 2] * (ax * y - ay * x)
    return total
