"""Kernels of what agents see: joint coordinates, and the twists ahead in the unit of their own speed."""

from __future__ import annotations

import math

import numpy as np

from ikgym.jit import kernel
from ikgym.rl.twists import is_turned, turn, twist, twist_size

#: Added to the speed of what is ahead, in [m/s], [rad/s] or [1/s]: at rest there is nothing to measure by.
SLOWEST = 0.02
#: Fewer steps left than this are seen: only then does the end of an episode matter.
STEPS_LEFT = 500.0
#: Added to |v̂|, so that an arm that is where it should be can still move.
LEAST = 0.2
#: Joint velocities are seen up to so many units.
FASTEST = 4.0


@kernel
def mean_twists(kind, dt, offsets, nominal, error, out):
    """The mean velocities between reference poses ahead.

    Args:
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        dt: Δt in [s].
        offsets: Shape (p,).
        nominal: Reference task coordinates at the offsets. Shape (p, m).
        error: Scratch. Shape (6,).
        out: Receives the mean twists between the offsets in [m/s] and [rad/s]. Shape (p - 1, w).

    Returns:
        The speed s of what is ahead: their root mean square, and a little more.
    """
    square = 0.0
    for i in range(out.shape[0]):
        twist(kind, nominal[i + 1], nominal[i], error, out[i])
        duration = (offsets[i + 1] - offsets[i]) * dt
        for a in range(out.shape[1]):
            out[i, a] /= duration
            square += out[i, a] * out[i, a]
    return SLOWEST + math.sqrt(square / out.size)


@kernel
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


@kernel
def command_unit(kind, prismatic, axis, lead, furthest, q, pose, nominal, speed, error, due):
    """The twist that is due, as a share of itself and a little more, and the unit of velocities that goes with it.

    Args:
        kind: Of task coordinates.
        prismatic: Which joints are prismatic. Shape (n,).
        axis: Of joint 1. Shape (3,).
        lead: Time in which the arm is to be at the next reference pose, in [s].
        furthest: Where |v̂| is cut.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        pose: Measured task coordinates. Shape (m,).
        nominal: The next reference task coordinates. Shape (m,).
        speed: s.
        error: Scratch. Shape (6,).
        due: Receives v̂ / (0.2 + |v̂|) with v̂ = v / s, seen from the frame of joint 1. Shape (w,).

    Returns:
        0.2 / (0.2 + |v̂|), and the unit s (0.2 + |v̂|) in [rad/s] or [m/s].
    """
    twist(kind, nominal, pose, error, due)
    if is_turned(kind, prismatic):
        turn(axis, -q[0], due)
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
def observe_rows(kind, prismatic, axis, dt, offsets, furthest, q, qdot, pose, nominal, remaining, out, unit):
    """What agents see, row by row, see :class:`ikgym.rl.AgentObservation`.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        axis: Of joint 1. Shape (3,).
        dt: Δt in [s].
        offsets: Steps ahead at which the reference is seen. Shape (p,).
        furthest: Where |v̂| is cut.
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
    shown = out.shape[1] - w - 1 - n
    for row in range(q.shape[0]):
        speed = mean_twists(kind, dt, offsets, nominal[row], error, ahead)
        features = out[row]
        feature_row(kind, prismatic, axis, q[row], ahead, speed, remaining[row, 0], features[:shown])
        features[shown + w], unit[row] = command_unit(
            kind, prismatic, axis, offsets[0] * dt, furthest, q[row], pose[row], nominal[row, 0], speed, error, due
        )
        for a in range(w):
            features[shown + a] = due[a]
        for j in range(n):
            features[shown + w + 1 + j] = min(max(qdot[row, j] / unit[row], -FASTEST), FASTEST)


@kernel
def unit_rows(kind, prismatic, axis, dt, offsets, furthest, q, pose, nominal, out):
    """The unit of velocities of each row, as :func:`observe_rows` gives it. ``out`` has shape (N,)."""
    w = twist_size(kind)
    error, due, ahead = np.empty(6), np.empty(w), np.empty((offsets.shape[0] - 1, w))
    for row in range(q.shape[0]):
        speed = mean_twists(kind, dt, offsets, nominal[row], error, ahead)
        _, out[row] = command_unit(
            kind, prismatic, axis, offsets[0] * dt, furthest, q[row], pose[row], nominal[row, 0], speed, error, due
        )


@kernel
def log_rewards(rewards, terminated, scale, charge, out):
    """Rewards of agents, in one loop for one arm and for many, see :class:`ikgym.rl.LogReward`.

    Args:
        rewards: −cost. Shape (N,).
        terminated: Where a track is lost. Shape (N,).
        scale: See there.
        charge: See there.
        out: Receives the rewards. Shape (N,).
    """
    for row in range(rewards.shape[0]):
        out[row] = 0.0 - scale * (charge if terminated[row] else 1.0) * math.log1p(-rewards[row])
