"""Kernels of the bilinear actor: its features, their gradient, and what the output of its network means."""

from __future__ import annotations

import math

import numpy as np

from baselines.agents.bilinear.twists import is_turned, shown_joints, turn, turn_gradient, twist, twist_size
from baselines.agents.feature_kernels import SLOWEST
from ikgym.jit import kernel

#: Fewer steps left than this are seen: only then does the end of an episode matter.
STEPS_LEFT = 500.0


@kernel
def feature_row(kind, prismatic, axis, dt, offsets, q, nominal, remaining, error, mean_twist, out):
    """The features of one arm, see :class:`baselines.agents.bilinear.Bilinear`.

    Args:
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        prismatic: Which joints are prismatic. Shape (n,).
        axis: Of joint 1. Shape (3,).
        dt: Δt in [s].
        offsets: Shape (p,).
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        nominal: Reference task coordinates at the offsets. Shape (p, m).
        remaining: Steps left.
        error: Scratch. Shape (6,).
        mean_twist: Scratch. Shape (w,).
        out: Receives the features. Shape (f,).

    Returns:
        The speed s of what is ahead.
    """
    turned, at, w = is_turned(kind, prismatic), 0, mean_twist.shape[0]
    for j in range(1 if turned else 0, q.shape[0]):
        if prismatic[j]:
            out[at] = q[j]
            at += 1
        else:
            out[at], out[at + 1] = math.sin(q[j]), math.cos(q[j])
            at += 2
    parts, square = offsets.shape[0] - 1, 0.0
    for i in range(parts):
        twist(kind, nominal[i + 1], nominal[i], error, mean_twist)
        if turned:
            turn(axis, -q[0], mean_twist)
        duration = (offsets[i + 1] - offsets[i]) * dt
        for a in range(w):
            velocity = mean_twist[a] / duration
            square += velocity * velocity
            out[at + i * w + a] = velocity
    speed = SLOWEST + math.sqrt(square / (parts * w))
    for i in range(at, at + parts * w):
        out[i] /= speed
    out[at + parts * w] = math.log(speed)
    out[at + parts * w + 1] = min(remaining / STEPS_LEFT, 1.0)
    return speed


@kernel
def feature_rows(kind, prismatic, axis, dt, offsets, q, nominal, remaining, out, speed):
    """:func:`feature_row`, row by row.

    Entered once a `predict`, with its arrays one by one as in :func:`baselines.agents.feature_kernels.feature_rows`.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        axis: Shape (3,).
        dt: Δt in [s].
        offsets: Shape (p,).
        q: Shape (B, n).
        nominal: At the offsets. Shape (B, p, m).
        remaining: Shape (B, 1).
        out: Receives the features. Shape (B, f).
        speed: Receives the speeds. Shape (B,).
    """
    error, mean_twist = np.empty(6), np.empty(twist_size(kind))
    for row in range(q.shape[0]):
        speed[row] = feature_row(
            kind, prismatic, axis, dt, offsets, q[row], nominal[row], remaining[row, 0], error, mean_twist, out[row]
        )


@kernel
def feature_gradient_rows(kind, prismatic, axis, features, gradient, out):
    """From the gradient by the features to that by the joint coordinates, row by row.

    The speed of what is ahead does not depend on where the arm is.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        axis: Shape (3,).
        features: What :func:`feature_rows` gave. Shape (B, f).
        gradient: By the features. Shape (B, f).
        out: Receives the gradient. Shape (B, n).
    """
    turned, n = is_turned(kind, prismatic), prismatic.shape[0]
    for row in range(features.shape[0]):
        x, g, at = features[row], gradient[row], 0
        out[row, 0] = 0.0
        for j in range(1 if turned else 0, n):
            if prismatic[j]:
                out[row, j] = g[at]
                at += 1
            else:
                out[row, j] = g[at] * x[at + 1] - g[at + 1] * x[at]
                at += 2
        if turned:
            out[row, 0] = turn_gradient(axis, x[at:-2], g[at:-2])


@kernel
def action_rows(kind, prismatic, axis, dt, velocity_limit, q, pose, nominal, speed, output, out):
    """The actions that network outputs mean, row by row: q̇ = G v + h s.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        axis: Shape (3,).
        dt: Δt in [s].
        velocity_limit: Shape (n,).
        q: Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        nominal: Reference task coordinates, of the next step first. Shape (B, p, m).
        speed: s. Shape (B,).
        output: Row j of G and h_j, joint by joint. Shape (B, n (w + 1)).
        out: Receives fractions of the velocity limit. Shape (B, n).
    """
    turned, n, w = is_turned(kind, prismatic), q.shape[1], twist_size(kind)
    error, due = np.empty(6), np.empty(w)
    for row in range(q.shape[0]):
        twist(kind, nominal[row, 0], pose[row], error, due)
        if turned:
            turn(axis, -q[row, 0], due)
        for j in range(n):
            own = output[row, j * (w + 1) : (j + 1) * (w + 1)]
            qdot = own[w] * speed[row]
            for a in range(w):
                qdot += own[a] * due[a] / dt
            out[row, j] = qdot / velocity_limit[j]


@kernel
def feature_count(kind, prismatic, offsets):
    """f, the number of features of an arm."""
    turned = is_turned(kind, prismatic)
    return shown_joints(turned, prismatic) + (offsets - 1) * twist_size(kind) + 2
