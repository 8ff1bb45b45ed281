"""Kernels: what the limits of an arm make of joint velocities."""

from __future__ import annotations

import math

from ikgym.jit import inlined

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
        last: What was applied in the step before, in [rad/s] or [m/s].
        slack: What a joint may lose without being held back, in [rad/s] or [m/s].
        at_limit: Joints held back; those by velocity and by acceleration are counted on. Shape (N, 3).
        row: The arm.
    """
    allowed, most = within(command, limits[FASTEST, j]), limits[CHANGE, j]
    change = allowed - last
    velocity = last + math.copysign(most, change) if abs(change) > most else allowed
    at_limit[row, 1] += abs(command - allowed) > slack
    at_limit[row, 2] += abs(allowed - velocity) > slack
    return velocity
