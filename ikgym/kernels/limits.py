"""Kernels: joint velocities within the limits of an arm."""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels.jit import inlined, kernel

# The rows of an arm's limits, see :func:`ikgym.arms.limits.limit_rows`.
LOWER, UPPER, FASTEST, CHANGE = range(4)
# A joint counts as held back where it loses more than this share of the velocity that an action of 1 means: actions in
# float32 round by 6e-8 of it, and who keeps a limit exactly is not held back.
SLACK = 1e-6


@inlined
def within(value, bound):
    """The value, no further from 0 than the bound."""
    return math.copysign(bound, value) if abs(value) > bound else value


@inlined
def driven(limits, j, command, last, slack, at_limit, row):
    """The velocity that joint ``j`` is driven at: the command within the limits of velocity and acceleration.

    Args:
        limits: Shape (4, n).
        j: The joint.
        command: In [rad/s] or [m/s].
        last: Velocity applied in the previous step, in [rad/s] or [m/s].
        slack: Loss of velocity below which a joint does not count as held back, in [rad/s] or [m/s].
        at_limit: Joints held back; those by velocity and by acceleration are counted on. Shape (N, 3).
        row: The arm.
    """
    allowed, most = within(command, limits[FASTEST, j]), limits[CHANGE, j]
    change = allowed - last
    velocity = last + math.copysign(most, change) if abs(change) > most else allowed
    at_limit[row, 1] += abs(command - allowed) > slack
    at_limit[row, 2] += abs(allowed - velocity) > slack
    return velocity


@inlined
def stopped(limits, j, here, reached, dt):
    """Final coordinate of joint ``j``, which would pass a stop, and the velocity that leads there.

    Args:
        limits: Shape (4, n).
        j: The joint.
        here: Its coordinate in [rad] or [m].
        reached: Where it would get to, beyond a stop.
        dt: Δt in [s].

    Returns:
        The stop in [rad] or [m], and the velocity in [rad/s] or [m/s].
    """
    stop = limits[LOWER, j] if reached < limits[LOWER, j] else limits[UPPER, j]
    return stop, within((stop - here) / dt, limits[FASTEST, j])


@kernel
def applied(limits, q, command, last, dt, out):
    """The joint velocities that limits make of a command, as in a step of the environment.

    Args:
        limits: Result of :func:`ikgym.arms.limits.limit_rows` for an arm with limits. Shape (4, n).
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        command: Joint velocities in [rad/s] or [m/s]. Shape (n,).
        last: Velocity applied in the previous step. Shape (n,).
        dt: Δt in [s].
        out: Receives those applied in this one. Shape (n,).
    """
    held = np.zeros((1, 3))
    for j in range(q.shape[0]):
        out[j] = driven(limits, j, command[j], last[j], 0.0, held, 0)
        reached = q[j] + dt * out[j]
        if not limits[LOWER, j] <= reached <= limits[UPPER, j]:
            _, out[j] = stopped(limits, j, q[j], reached, dt)
