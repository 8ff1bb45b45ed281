"""Kernels: joint velocities within the limits of an arm."""

from __future__ import annotations

import math

from ikgym.kernels.jit import inlined

# The rows of an arm's limits, see :func:`ikgym.arms.limits.limit_rows`.
LOWER, UPPER, FASTEST, CHANGE = range(4)
# A joint counts as held back where it loses more than this share of the velocity that an action of 1 means: actions in
# float32 round by 6e-8 of it, and who keeps a limit exactly is not held back.
SLACK = 1e-6


@inlined
def clip(value, bound):
    """The value, no further from 0 than the bound."""
    return math.copysign(bound, value) if abs(value) > bound else value


@inlined
def limit_change(limits, j, velocity, last):
    """A velocity of joint ``j`` within its acceleration limit, in [rad/s] or [m/s]; ``last`` is that of before."""
    most, change = limits[CHANGE, j], velocity - last
    return last + math.copysign(most, change) if abs(change) > most else velocity


@inlined
def limit_command(limits, j, command, last, slack, at_limit, row):
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
    allowed = clip(command, limits[FASTEST, j])
    velocity = limit_change(limits, j, allowed, last)
    at_limit[row, 1] += abs(command - allowed) > slack
    at_limit[row, 2] += abs(allowed - velocity) > slack
    return velocity


@inlined
def stop_at_limit(limits, j, here, reached, dt):
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
    return stop, clip((stop - here) / dt, limits[FASTEST, j])


@inlined
def ideal_velocity(limits, j, here, command, last, dt):
    """The velocity of joint ``j`` after a step of an ideal plant, in [rad/s] or [m/s].

    Args:
        limits: Result of :func:`ikgym.arms.limits.limit_rows`. Shape (4, n), or (0, n) where there are none.
        j: The joint.
        here: Its coordinate in [rad] or [m].
        command: In [rad/s] or [m/s].
        last: Velocity applied in the previous step, in [rad/s] or [m/s].
        dt: Δt in [s].
    """
    if limits.shape[0] == 0:
        return command
    velocity = limit_change(limits, j, clip(command, limits[FASTEST, j]), last)
    reached = here + dt * velocity
    if not limits[LOWER, j] <= reached <= limits[UPPER, j]:
        _, velocity = stop_at_limit(limits, j, here, reached, dt)
    return velocity
