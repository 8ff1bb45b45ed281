"""Kernels of the features of learning agents: the required twist, each joint's share in it, and the twists ahead."""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.rl.twists import is_turned, turn, twist, twist_size

#: Added to the speed of the reference, in [m/s], [rad/s] or [1/s], since a reference at rest has no scale.
SLOWEST = 0.02
#: Steps left are shown below this number, where the end of an episode matters.
STEPS_LEFT = 500.0
#: Added to |v̂|, so that an arm without error can still move.
LEAST = 0.2
#: Bound of joint velocities in units.
FASTEST = 4.0
#: Bound of the products of required twist and Jacobian.
MOST = 10.0
#: 1 rad weighs as much as this share of the arm's length, so that position and orientation are comparable.
RADIAN = 0.25
#: Scale of the features that matter less in each step, so that a network begins with the important ones.
CONTEXT = 0.3


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
    """The features of one arm, as :class:`ikgym.rl.AgentObservation` lists them.

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
def command_unit(kind, lead, furthest, pose, nominal, speed, error, due):
    """The required twist, normalised, and the unit of velocities.

    Args:
        kind: Of task coordinates.
        lead: Time until the next reference pose, in [s].
        furthest: Bound of |v̂|.
        pose: Measured task coordinates. Shape (m,).
        nominal: The next reference task coordinates. Shape (m,).
        speed: s.
        error: Scratch. Shape (6,).
        due: Receives v̂ / (0.2 + |v̂|) with v̂ = v / s, in the base frame. Shape (w,).

    Returns:
        0.2 / (0.2 + |v̂|), and the unit s (0.2 + |v̂|) in [rad/s] or [m/s].
    """
    twist(kind, nominal, pose, error, due)
    square = 0.0
    for a in range(due.shape[0]):
        due[a] /= lead * speed
        square += due[a] * due[a]
    size = math.sqrt(square)
    kept = min(size, furthest)
    share = kept / size if size > kept else 1.0
    for a in range(due.shape[0]):
        due[a] *= share / (LEAST + kept)
    return LEAST / (LEAST + kept), speed * (LEAST + kept)


@kernel
def radian(chain):
    """Weight of 1 rad in [m]: a quarter of the arm's length from joint to joint, 1 m for an arm without length."""
    length = math.sqrt(np.sum(chain.tool**2))
    for j in range(chain.offsets.shape[0]):
        length += math.sqrt(np.sum(chain.offsets[j] ** 2))
    return RADIAN * length if length > 0.0 else 1.0


@inner
def along_joints(kind, chain, metres, q, due, rotation, position, jacobians, out):
    """Each joint's column of the Jacobian times the required twist.

    Position is in units of :func:`radian`, so that it is comparable with orientation.

    Args:
        kind: Of task coordinates.
        chain: The arm's model, see :class:`ikgym.kernels.kinematics.Chain`.
        metres: Weight of 1 rad, see :func:`radian`.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        due: As :func:`command_unit` gives it. Shape (w,).
        rotation: Scratch. Shape (3, 3).
        position: Scratch. Shape (3,).
        jacobians: Scratch. Shape (2, 6, n).
        out: Receives the products, those of the first three components first. Shape (w // 3 * n,).
    """
    rows, n = jacobians[0], q.shape[0]
    forward_and_jacobian(chain, q, rotation, position, rows)
    if kind == task_kernels.SKEW:
        rows = jacobians[1]
        task_kernels.jacobian(kind, rotation, jacobians[0], rows)
    for first in range(0, due.shape[0], 3):
        unit = metres if first == 0 else 1.0
        for j in range(n):
            product = 0.0
            for a in range(first, first + 3):
                product += rows[a, j] * due[a]
            product /= unit * unit
            out[first // 3 * n + j] = min(max(product, -MOST), MOST)


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


@kernel
def observe_rows(kind, chain, dt, offsets, furthest, q, qdot, pose, nominal, remaining, out, unit):
    """The features row by row, see :class:`ikgym.rl.AgentObservation`.

    Args:
        kind: Of task coordinates.
        chain: The arm's model, see :class:`ikgym.kernels.kinematics.Chain`.
        dt: Δt in [s].
        offsets: Steps ahead at which the reference is shown. Shape (p,).
        furthest: Bound of |v̂|.
        q: In [rad] or [m]. Shape (N, n).
        qdot: In [rad/s] or [m/s]. Shape (N, n).
        pose: Shape (N, m).
        nominal: At the offsets. Shape (N, p, m).
        remaining: Shape (N, 1).
        out: Receives the features. Shape (N, f).
        unit: Receives the units of velocities. Shape (N,).
    """
    w, n = twist_size(kind), q.shape[1]
    error, due, ahead = np.empty(6), np.empty(w), np.empty((offsets.shape[0] - 1, w))
    rotation, position, jacobians, along = np.empty((3, 3)), np.empty(3), np.empty((2, 6, n)), np.empty(w // 3 * n)
    axis, metres = chain.axes[0], radian(chain)
    moving = w + 1 + along.shape[0]
    for row in range(q.shape[0]):
        speed, features = mean_twists(kind, dt, offsets, nominal[row], error, ahead), out[row]
        features[w], unit[row] = command_unit(
            kind, offsets[0] * dt, furthest, pose[row], nominal[row, 0], speed, error, due
        )
        along_joints(kind, chain, metres, q[row], due, rotation, position, jacobians, along)
        if is_turned(kind, chain.prismatic):
            turn(axis, -q[row, 0], due)
        features[:w], features[w + 1 : moving] = due, along
        for j in range(n):
            features[moving + j] = min(max(qdot[row, j] / unit[row], -FASTEST), FASTEST)
        context = features[moving + n :]
        feature_row(kind, chain.prismatic, axis, q[row], ahead, speed, remaining[row, 0], context)
        context *= CONTEXT


@kernel
def unit_rows(kind, dt, offsets, furthest, pose, nominal, out):
    """The unit of velocities of each row, as :func:`observe_rows` gives it. ``out`` has shape (N,)."""
    w = twist_size(kind)
    error, due, ahead = np.empty(6), np.empty(w), np.empty((offsets.shape[0] - 1, w))
    for row in range(pose.shape[0]):
        speed = mean_twists(kind, dt, offsets, nominal[row], error, ahead)
        _, out[row] = command_unit(kind, offsets[0] * dt, furthest, pose[row], nominal[row, 0], speed, error, due)


@kernel
def log_rewards(rewards, scale, worst, out):
    """Rewards of agents, in one loop for one arm and for many, see :class:`ikgym.rl.LogReward`.

    Args:
        rewards: −cost. Shape (N,).
        scale: See there.
        worst: See there.
        out: Receives the rewards. Shape (N,).
    """
    for row in range(rewards.shape[0]):
        out[row] = scale * max(1.0 - math.log1p(-rewards[row]) / worst, 0.0)
