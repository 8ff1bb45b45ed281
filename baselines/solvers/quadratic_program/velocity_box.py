"""Kernels: how fast the joints of an arm may go in the next step, so that all of its limits can be kept for good."""

from __future__ import annotations

import math

from baselines.policy_kernels import BRAKING, JERK
from ikgym.kernels.jit import inlined, uncounted
from ikgym.kernels.limits import CHANGE, FASTEST, LOWER, UPPER

# Most steps of a stop, and halvings of the range of velocities from which a joint can stop in time.
LONGEST, HALVINGS = 100_000, 24


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
    """The largest velocity towards a stop; where the joint is beyond it, the one that leads back and ends there."""
    return math.copysign(min(braking_speed(abs(distance) / dt, change), fastest), distance)


@uncounted
def velocity_box(limits, dt, q, last, lower, upper):
    """Least and largest joint velocities of the next step.

    Where limits contradict each other, since the joint was too fast before, the acceleration limit wins: a joint that
    cannot brake in time brakes as hard as it can, and one beyond its velocity limit likewise. Where a joint is beyond a
    stop (of a model whose stops are not those of the arm) it is led back, no faster than it can come to rest at the
    stop, and the opposite stop gives way.

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


@inlined
def stopping_change(velocity, change, most, step):
    """The next change of a velocity on the fastest way to rest, with a bounded jerk.

    The velocity reaches 0 together with its change: the last changes shrink by ``step`` each, as the velocities do in
    :func:`braking_speed`. A velocity that cannot avoid passing through 0 returns to it.

    Args:
        velocity: v of the last step, in [rad/s] or [m/s].
        change: By how much it differed from the one before.
        most: The largest change in one step; inf where there is no limit.
        step: The largest change of that from step to step.
    """
    needed = min(most, braking_speed(abs(velocity), step))
    return min(max(-math.copysign(needed, velocity), change - step), change + step)


@inlined
def reachable_change(change, room, most, step):
    """The largest next change of a velocity with a given room to its limit, with a bounded jerk.

    The changes that follow it can shrink to 0 before the limit. ``change`` is the last one; for the others see
    :func:`stopping_change`.
    """
    return min(most, change + step, max(braking_speed(max(room, 0.0), step), change - step))


@uncounted
def stopping_way(velocity, change, most, step):
    """How far a joint still moves forward on the fastest way to rest, divided by Δt, in [rad/s] or [m/s].

    For the arguments see :func:`stopping_change`. The steps of the largest change, of which there are many, are taken
    at once.
    """
    way, farthest, whole = 0.0, 0.0, 0.0
    if most < math.inf:
        ramps = math.ceil(most / step) - 1.0
        whole = most + ramps * most - 0.5 * step * ramps * (ramps + 1.0)  # that a change from `most` to 0 makes
    for _ in range(LONGEST):
        if velocity <= 0.0 and change <= 0.0:
            break
        change = stopping_change(velocity, change, most, step)
        velocity += change
        way += velocity
        if change == -most and velocity > whole:
            times = math.floor((velocity - whole) / most) + 1.0
            way += times * velocity - 0.5 * most * times * (times + 1.0)
            velocity -= times * most
        farthest = max(farthest, way)
    return farthest


@inlined
def longest_way(velocity, change, most, step):
    """An upper bound of :func:`stopping_way`: the largest velocity on the way, for longer than a stop takes.

    It saves the sum where a joint is far from its stop. For the arguments see :func:`stopping_change`.
    """
    rising = max(change, 0.0)
    fastest = max(velocity, 0.0) + rising * (rising / step + 1.0)
    hardest = min(most, math.sqrt(fastest * step))
    return fastest * ((rising + hardest) / step + fastest / hardest + 6.0) if fastest > 0.0 else 0.0


@uncounted
def _fastest_forward(room, velocity, change, most, step, limit):
    """The largest next velocity from which a joint can stop within its room, with a bounded jerk.

    Args:
        room: The way to the stop, divided by Δt, in [rad/s] or [m/s].
        velocity: v of the last step, in [rad/s] or [m/s].
        change: By how much it differed from the one before.
        most: The largest change in one step; inf where there is no limit.
        step: The largest change of that from step to step.
        limit: The largest velocity.
    """
    low = velocity + stopping_change(velocity, change, most, step)
    high = max(min(velocity + reachable_change(change, limit - velocity, most, step), limit), low)
    if high + longest_way(high, high - velocity, most, step) <= room:
        return high
    if high + stopping_way(high, high - velocity, most, step) <= room:
        return high
    if low + stopping_way(low, low - velocity, most, step) > room:
        return low
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if middle + stopping_way(middle, middle - velocity, most, step) <= room:
            low = middle
        else:
            high = middle
    return low


@inlined
def calm_gain(limits, gain):
    """The share of an error that is corrected in a step, smaller where an acceleration takes some steps to build up.

    A larger one would let an arm with limits of jerk swing about its reference. Without a limit of acceleration, the
    largest one is that from which a joint reaches its velocity limit. ``limits`` have the shape (6, n).
    """
    for j in range(limits.shape[1]):
        step = limits[JERK, j]
        if step < math.inf:
            largest = min(limits[BRAKING, j], braking_speed(limits[FASTEST, j], step))
            gain = min(gain, 1.0 / (1.0 + largest / step))
    return gain


@uncounted
def smooth_box(limits, dt, q, last, change, lower, upper):
    """Least and largest joint velocities of the next step, with a bounded jerk where there is a limit of it.

    As :func:`velocity_box`, for joints whose row JERK of the limits is finite: whatever velocity of the box is chosen,
    the next box is not empty, and the fastest stop (:func:`stopping_change`) lies in it. Where limits contradict each
    other, since the joint was too fast before or its measurement has moved, jerk comes first, then acceleration.

    Args:
        limits: See :class:`baselines.policy_kernels.Model`. Shape (6, n).
        dt: Δt in [s].
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        last: The joint velocities of the step before in [rad/s] or [m/s]. Shape (n,).
        change: By how much they differed from those before. Shape (n,).
        lower: Receives the least velocities in [rad/s] or [m/s], never above the largest. Shape (n,).
        upper: Receives the largest. Shape (n,).
    """
    velocity_box(limits, dt, q, last, lower, upper)
    for j in range(q.shape[0]):
        if limits[JERK, j] < math.inf:
            most, step, fastest, v, d = limits[BRAKING, j], limits[JERK, j], limits[FASTEST, j], last[j], change[j]
            above, below = (limits[UPPER, j] - q[j]) / dt, (q[j] - limits[LOWER, j]) / dt
            quickest, slowest = v + min(most, d + step), v - min(most, step - d)
            # The fastest stop lies between both.
            upper[j] = _fastest_forward(above, v, d, most, step, fastest)
            lower[j] = -_fastest_forward(below, -v, -d, most, step, fastest)
            if above < 0.0:  # beyond a stop: led back
                upper[j] = min(max(-_fastest_forward(-above, -v, -d, most, step, fastest), lower[j]), quickest)
            elif below < 0.0:
                lower[j] = max(min(_fastest_forward(-below, v, d, most, step, fastest), upper[j]), slowest)
