"""Kernels: how fast the joints of an arm may go in the next step, so that all of its limits can be kept for good."""

from __future__ import annotations

import math

from baselines.policy_kernels import BRAKING
from ikgym.kernels.jit import inlined, uncounted
from ikgym.kernels.limits import CHANGE, FASTEST, LOWER, UPPER


@inlined
def braking_speed(room, change):
    """The largest speed from which a joint comes to rest within its room, braking from the next step on.

    A joint that makes v in this step and loses at most c in each of the next ones covers v + (v - c) + (v - 2 c) + …,
    down to 0. That is m v - c m (m - 1) / 2 for m steps of motion, (m - 1) c < v <= m c.

    Args:
        room: The way to the stop, divided by Δt, in [rad/s] or [m/s]; at least 0, inf where there is none.
        change: c, the largest change of the velocity in one step, in [rad/s] or [m/s]; inf where there is no limit.
    """
    if room <= change or math.isinf(room):
        return room
    steps = math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * room / change) - 1.0))
    return (room + 0.5 * change * steps * (steps - 1.0)) / steps


@inlined
def _towards(distance, dt, change, fastest):
    """The largest velocity towards a stop; where the joint is beyond it, the one that leads back."""
    room = distance / dt
    return min(braking_speed(room, change), fastest) if room >= 0.0 else max(room, -fastest)


@uncounted
def velocity_box(limits, dt, q, last, lower, upper):
    """Least and largest joint velocities of the next step.

    Where limits contradict each other, since the joint was too fast before, the acceleration limit wins: a joint that
    cannot brake in time brakes as hard as it can, and one beyond its velocity limit likewise. Where a joint is beyond a
    stop (of a model whose stops are not those of the arm) it is led back, and the opposite stop gives way.

    Args:
        limits: See :class:`Model`. Shape (5, n).
        dt: Δt in [s].
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        last: The joint velocities of the step before in [rad/s] or [m/s]. Shape (n,).
        lower: Receives the least velocities in [rad/s] or [m/s], never above the largest. Shape (n,).
        upper: Receives the largest. Shape (n,).
    """
    for j in range(q.shape[0]):
        fastest, change, braking = limits[FASTEST, j], limits[CHANGE, j], limits[BRAKING, j]
        most = _towards(limits[UPPER, j] - q[j], dt, braking, fastest)
        least = -_towards(q[j] - limits[LOWER, j], dt, braking, fastest)
        if least > most:  # beyond one of the stops
            least = most = most if q[j] > limits[UPPER, j] else least
        slowest, quickest = last[j] - change, last[j] + change
        upper[j] = min(max(most, slowest), quickest)
        lower[j] = min(max(least, slowest), quickest)
