"""Kernels of the features of bilinear agents: posture, and the twists of the reference ahead."""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.rl.twists import is_turned, turn, twist, twist_size

#: Added to the speed of the reference, in [m/s], [rad/s] or [1/s], since a reference at rest has no scale.
SLOWEST = 0.02
#: Steps left are shown below this number, where the end of an episode matters.
STEPS_LEFT = 500.0
#: Scale of the features that matter less in each step, so that a network begins with the important ones.
CONTEXT = 0.3


@kernel
def shown_joints(kind, prismatic):
    """Number of features of joint coordinates: one for a prismatic joint, two for a revolute one."""
    shown = 0
    for j in range(1 if is_turned(kind, prismatic) else 0, prismatic.shape[0]):
        shown += 1 if prismatic[j] else 2
    return shown


@inner
def mean_twists(kind, dt, offsets, nominal, error, out):
    """The mean velocities between reference poses ahead.

    Args:
        kind: Of task coordinates, see :mod:`ikgym.kernels.tasks`.
        dt: Δt in [s].
        offsets: Shape (p,).
        nominal: Reference task coordinates at the offsets. Shape (p, m).
        error: Scratch. Shape (6,).
        out: Receives the mean twists between the offsets in [m/s] and [rad/s]. Shape (p - 1, w).

    Returns:
        The speed s: their root mean square, and 0.02.
    """
    square = 0.0
    for i in range(out.shape[0]):
        twist(kind, nominal[i + 1], nominal[i], error, out[i])
        duration = (offsets[i + 1] - offsets[i]) * dt
        for a in range(out.shape[1]):
            out[i, a] /= duration
            square += out[i, a] * out[i, a]
    return SLOWEST + math.sqrt(square / out.size)


@inner
def feature_row(kind, prismatic, axis, q, ahead, speed, remaining, out):
    """The features of one arm, as :class:`baselines.agents.bilinear.processing.Bilinear` lists them.

    Args:
        kind: Of task coordinates.
        prismatic: Which joints are prismatic. Shape (n,).
        axis: Of joint 1. Shape (3,).
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        ahead: Mean twists; turned in place. Shape (p - 1, w).
        speed: s.
        remaining: Steps left.
        out: Receives the features. Shape (f,).
    """
    turned, at = is_turned(kind, prismatic), 0
    for j in range(1 if turned else 0, q.shape[0]):
        if prismatic[j]:
            out[at] = q[j]
            at += 1
        else:
            out[at], out[at + 1] = math.sin(q[j]), math.cos(q[j])
            at += 2
    for i in range(ahead.shape[0]):
        if turned:
            turn(axis, -q[0], ahead[i])
        for a in range(ahead.shape[1]):
            out[at] = ahead[i, a] / speed
            at += 1
    out[at], out[at + 1] = math.log(speed), min(remaining / STEPS_LEFT, 1.0)


@inner
def context_rows(kind, prismatic, axis, dt, offsets, q, nominal, remaining, out, speed):
    """:func:`feature_row` of N arms: posture, twists ahead, their speed, and steps left.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        axis: Shape (3,).
        dt: Δt in [s].
        offsets: Steps ahead at which the reference is shown. Shape (p,).
        q: Shape (N, n).
        nominal: At the offsets. Shape (N, p, m).
        remaining: Shape (N, 1).
        out: Receives the features in its first columns. Shape (N, f).
        speed: Receives the speeds s. Shape (N,).
    """
    error, ahead = np.empty(6), np.empty((offsets.shape[0] - 1, twist_size(kind)))
    for row in range(q.shape[0]):
        speed[row] = mean_twists(kind, dt, offsets, nominal[row], error, ahead)
        feature_row(kind, prismatic, axis, q[row], ahead, speed[row], remaining[row, 0], out[row])


@inner
def seen_jacobian(kind, chain, q, joints, rotation, position, out):
    """The geometric Jacobian from the frame in which twists are seen: that of joint 1, as if it stood at 0.

    Args:
        kind: Of task coordinates; not skew ones, which are no twists.
        chain: The arm's model, see :class:`ikgym.kernels.kinematics.Chain`.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        joints: Scratch. Shape (n,).
        rotation: Scratch. Shape (3, 3).
        position: Scratch. Shape (3,).
        out: Receives the Jacobian; tasks of position have its first three rows. Shape (6, n).
    """
    joints[:] = q
    if is_turned(kind, chain.prismatic):
        joints[0] = 0.0
    forward_and_jacobian(chain, joints, rotation, position, out)
