"""Kernels of the features of bilinear agents: posture, twists of the reference ahead, and the joint rates for them.

Joint rates are those at predicted postures. From where the arm is, damped least-squares steps lead to one reference
pose ahead after the other,

    q_0 = q + S(q) e_0(q),  q_(i+1) = q_i + S(q_i) e_(i+1)(q_i),  S = Jᵀ (J Jᵀ + λ I)⁻¹,

with e_i(q) the twist from the pose at q to the reference at offset o_i. The step divided by its time is a joint rate. A
singularity ahead shows in the rates that it will require, while there is time to go around it.

The rates of the first twist give the metric that a network changes, so that a fast joint counts less. With U = |q̇|⁻² a
weighted least-squares step approaches the least sum of fourth powers, which joint velocities cost (iteratively
reweighted least squares, Burrus 1994); the exponent allows for a single step.
"""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.kernels.limits import clip
from ikgym.kernels.linear_algebra import damped_step
from ikgym.rl.twists import is_turned, turn, twist, twist_size

#: Added to the speed of the reference, in [m/s], [rad/s] or [1/s], since a reference at rest has no scale.
SLOWEST = 0.02
#: Steps left are shown below this number, where the end of an episode matters.
STEPS_LEFT = 500.0
#: Scale of the features that matter less in each step, so that a network begins with the important ones.
CONTEXT = 0.3
#: λ of the joint rates, which bounds them near a singularity.
DAMPING = 1e-2
#: Largest step of a joint in [rad] or [m]: far off the path, predictions would be wild.
FARTHEST = 0.5
#: θ of the metric U_j = (q̇_j² / mean q̇² + ε)^-θ, and ε, which bounds it for a joint at rest.
EXPONENT, AT_REST = 0.3, 0.1
#: Added to the mean of the squares, which may be 0.
LITTLE = 1e-6


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


@kernel
def feature_rows(kind, chain, dt, offsets, q, nominal, remaining, out, speed):
    """The features of the network, row by row.

    Args:
        kind: Of task coordinates, except skew ones, whose errors are no twists.
        chain: The arm.
        dt: Δt in [s].
        offsets: Steps ahead at which the reference is shown. Shape (p,).
        q: Shape (B, n).
        nominal: At the offsets. Shape (B, p, m).
        remaining: Shape (B, 1).
        out: Receives the features. Shape (B, f).
        speed: Receives the speeds s. Shape (B,).
    """
    error, ahead = np.empty(6), np.empty((offsets.shape[0] - 1, twist_size(kind)))
    for row in range(q.shape[0]):
        speed[row] = mean_twists(kind, dt, offsets, nominal[row], error, ahead)
        feature_row(kind, chain.prismatic, chain.axes[0], q[row], ahead, speed[row], remaining[row, 0], out[row])
    rate_rows(kind, chain, dt, offsets, q, nominal, speed, out)


@inner
def rate_rows(kind, chain, dt, offsets, q, nominal, speed, features):
    """Appends the joint rates between the offsets to features, in units of the speed of the reference ahead.

    Args:
        kind: Of task coordinates, except skew ones, whose errors are no twists.
        chain: The arm.
        dt: Δt in [s].
        offsets: Shape (p,).
        q: Shape (B, n).
        nominal: Reference task coordinates at the offsets. Shape (B, p, m).
        speed: Shape (B,).
        features: Receives the rates in its last columns. Shape (B, f + (p - 1) n).
    """
    n, w, first = q.shape[1], twist_size(kind), features.shape[1] - (offsets.shape[0] - 1) * q.shape[1]
    rotation, position, jacobian, pose = np.empty((3, 3)), np.empty(3), np.empty((6, n)), np.empty(nominal.shape[2])
    gram, scratch, error, due = np.empty((w, w)), np.empty(w), np.empty(6), np.empty(w)
    posture, step = np.empty(n), np.empty(n)
    for row in range(q.shape[0]):
        posture[:] = q[row]
        for i in range(offsets.shape[0]):
            forward_and_jacobian(chain, posture, rotation, position, jacobian)
            task_kernels.coordinates(kind, rotation, position, pose)
            twist(kind, nominal[row, i], pose, error, due)
            if not damped_step(jacobian[:w], due, DAMPING, gram, scratch, step):
                step[:] = np.nan  # an unknown rate must not fill_kinematics like a rate of 0
            for j in range(n):
                step[j] = clip(step[j], FARTHEST)
                posture[j] += step[j]
                if i > 0:
                    unit = (offsets[i] - offsets[i - 1]) * dt * speed[row]
                    features[row, first + (i - 1) * n + j] = CONTEXT * step[j] / unit


@kernel
def metric_rows(kind, prismatic, twists, features, output):
    """Adds the logarithm of the metric to the last outputs of a network, row by row.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        twists: p - 1.
        features: With joint rates, see :func:`rate_rows`. Shape (B, f).
        output: Of the network; in the end ln U. Shape (B, n (w + 1) + 1 + n).
    """
    n = prismatic.shape[0]
    first, last = shown_joints(kind, prismatic) + twists * twist_size(kind) + 2, output.shape[1] - n
    for row in range(output.shape[0]):
        mean = LITTLE
        for j in range(n):
            mean += features[row, first + j] ** 2 / n
        for j in range(n):
            output[row, last + j] -= EXPONENT * math.log(features[row, first + j] ** 2 / mean + AT_REST)


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
