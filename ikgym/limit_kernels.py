"""Kernels: what the limits of an arm make of joint velocities."""

from __future__ import annotations

from ikgym.jit import inlined

# The rows of an arm's limits, see :func:`ikgym.arms.limits.limit_rows`.
LOWER, UPPER, FASTEST, CHANGE = range(4)


@inlined
def driven(limits, j, command, last, at_limit):
    """The velocity that joint ``j`` is driven at: the command within its limits of velocity and acceleration.

    Args:
        limits: Shape (4, n).
        j: The joint.
        command: In [rad/s] or [m/s].
        last: What was applied in the step before, in [rad/s] or [m/s].
        at_limit: Joints held back by a stop, by velocity and by acceleration; the last two are counted on. Shape (3,).
    """
    velocity = within(command, limits[FASTEST, j])
    if velocity != command:
        at_limit[1] += 1.0
    least, most = last - limits[CHANGE, j], last + limits[CHANGE, j]
    changed = min(max(velocity, least), most)
    if changed != velocity:
        at_limit[2] += 1.0
    return changed


@inlined
def within(value, bound):
    """The value, no further from 0 than the bound."""
    return min(max(value, -bound), bound)
