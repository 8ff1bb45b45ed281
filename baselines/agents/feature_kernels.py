"""Kernels of an agent's features, and of what its network output means."""

from __future__ import annotations

import math

import numpy as np

from baselines.solvers.linear_algebra import damped_step
from ikgym import task_kernels
from ikgym.jit import inlined, kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.rl.feature_kernels import SLOWEST

#: Beyond this no feature goes: asinh has turned 1e5 into 12 there.
LARGEST = 12.0


@inlined
def compressed(x):
    """Asinh x, cut at ±LARGEST."""
    return min(max(math.asinh(x), -LARGEST), LARGEST)


@kernel
def speed_of(kind, dt, offsets, nominal, velocities):
    """The speed of what is to come, in the unit of task velocities.

    Args:
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        dt: Δt in [s].
        offsets: Shape (p,).
        nominal: At the offsets. Shape (p, m).
        velocities: Receives the mean velocities between the offsets in its first rows. Shape (p, e).
    """
    square, parts = 0.0, offsets.shape[0] - 1
    for i in range(parts):
        task_kernels.error(kind, nominal[i + 1], nominal[i], velocities[i])
        duration = (offsets[i + 1] - offsets[i]) * dt
        for a in range(velocities.shape[1]):
            velocities[i, a] /= duration
            square += velocities[i, a] * velocities[i, a]
    return SLOWEST + math.sqrt(square / (parts * velocities.shape[1]))


@kernel
def speed_rows(kind, dt, offsets, nominal, velocities):
    """What :func:`speed_of` gives, row by row.

    Args:
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        dt: Δt in [s].
        offsets: Shape (p,).
        nominal: At the offsets. Shape (B, p, m).
        velocities: Receives the mean velocities between the offsets in its first rows. Shape (B, p, e).

    Returns:
        Shape (B,).
    """
    out = np.empty(nominal.shape[0])
    for row in range(nominal.shape[0]):
        out[row] = speed_of(kind, dt, offsets, nominal[row], velocities[row])
    return out


@kernel
def feature_rows(
    kind,
    prismatic,
    dt,
    delta_x,
    velocity_limit,
    offsets,
    q,
    qdot,
    pose,
    nominal,
    remaining,
    base,
    velocities,
    out,
):
    """The features of :class:`Processing`, row by row.

    Entered once a `predict`: with its arrays one by one a call takes 3 µs, with named tuples of them 13 µs.

    Args:
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        prismatic: Which joints are prismatic. Shape (n,).
        dt: Δt in [s].
        delta_x: Δx of the cost.
        velocity_limit: Shape (n,).
        offsets: Shape (p,).
        q: Shape (B, n).
        qdot: Shape (B, n).
        pose: Shape (B, m).
        nominal: At the offsets. Shape (B, p, m).
        remaining: Shape (B, 1).
        base: Actions of the base policy. Shape (B, n), or (B, 0) where there is none.
        velocities: Scratch. Shape (p, e).
        out: Receives the features. Shape (B, f).
    """
    n, (p, e) = q.shape[1], velocities.shape
    for row in range(q.shape[0]):
        features = out[row]
        speed = speed_of(kind, dt, offsets, nominal[row], velocities)
        for j in range(n):
            if prismatic[j]:
                features[2 * j], features[2 * j + 1] = compressed(q[row, j]), 0.0
            else:
                features[2 * j], features[2 * j + 1] = math.sin(q[row, j]), math.cos(q[row, j])
            features[2 * n + j] = compressed(qdot[row, j] / speed)
        error, lead = velocities[p - 1], offsets[0] * dt
        task_kernels.error(kind, nominal[row, 0], pose[row], error)
        at = 3 * n
        for a in range(e):
            features[at + a] = compressed((error[a] - lead * velocities[0, a]) / delta_x)
            features[at + e + a] = compressed(error[a] / (lead * speed))
            for i in range(p - 1):
                features[at + (2 + i) * e + a] = compressed(velocities[i, a] / speed)
        at += (1 + p) * e
        features[at] = math.log(speed)
        features[at + 1] = min(remaining[row, 0] / offsets[p - 1], 1.0)
        for j in range(base.shape[1]):
            features[at + 2 + j] = compressed(base[row, j] * velocity_limit[j] / speed)


@kernel
def action_rows(chain, kind, dt, velocity_limit, offsets, action_scale, damping, q, nominal, output, velocities, out):
    """Adds what the network outputs mean to actions, row by row.

    Entered once a `predict`: with its arguments one by one a call takes 3.0 µs, with a named tuple of them 3.9 µs.

    Args:
        chain: The model of the arm.
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        dt: Δt in [s].
        velocity_limit: Shape (n,).
        offsets: Shape (p,).
        action_scale: See :class:`Processing`.
        damping: λ of the projector, 0 for none.
        q: Shape (B, n).
        nominal: At the offsets. Shape (B, p, m).
        output: Of the network; cut to [-1, 1] in place. Shape (B, n).
        velocities: Scratch. Shape (p, e).
        out: The actions. Shape (B, n).
    """
    for row in range(q.shape[0]):
        for j in range(output.shape[1]):
            output[row, j] = min(max(output[row, j], -1.0), 1.0)
    if damping > 0.0:
        project_rows(chain, kind, damping, velocities.shape[1], q, output)
    for row in range(q.shape[0]):
        scale = action_scale * speed_of(kind, dt, offsets, nominal[row], velocities)
        for j in range(output.shape[1]):
            out[row, j] += scale * output[row, j] / velocity_limit[j]


@kernel
def project_rows(chain, kind, damping, size, q, velocity):
    """Multiplies joint velocities by I − Jᵀ (J Jᵀ + λ I)⁻¹ J, in place.

    Args:
        chain: The model of the arm.
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        damping: λ, above 0.
        size: e, errors of the task.
        q: Shape (B, n).
        velocity: Shape (B, n).
    """
    n = q.shape[1]
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    jacobian, gram, moved, taken_off = np.empty((size, n)), np.empty((size, size)), np.empty(size), np.empty(n)
    scratch = np.empty(size)
    for row in range(q.shape[0]):
        forward_and_jacobian(chain, q[row], rotation, position, geometric)
        task_kernels.jacobian(kind, rotation, geometric, jacobian)
        for a in range(size):
            moved[a] = 0.0
            for j in range(n):
                moved[a] += jacobian[a, j] * velocity[row, j]
        # Damping that is too small to count leaves nothing of the velocity, rather than rounding errors.
        if not damped_step(jacobian, moved, damping, gram, scratch, taken_off):
            velocity[row] = 0.0
            continue
        for j in range(n):
            velocity[row, j] -= taken_off[j]
