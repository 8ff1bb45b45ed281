"""A motion of steps as trajectory controllers interpolate it: points of a cubic spline, from rest to rest."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from baselines.solvers.quadratic_program.velocity_box import stopping_change
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray

#: Largest ratio of accelerations of the spline to those of the motion.
EXCESS = 1.095
#: Accelerations below this share of the largest one of all joints count as that share.
FLOOR = 1e-2
#: Periods in which the spline catches up with a motion that begins with a jump of its velocity.
CATCH_UP = 22
#: Fewest periods of a stop.
FEWEST = 10
#: The largest slope of 3 u² − 2 u³.
STEEPEST = 1.5


class Points(NamedTuple):
    """Points of a trajectory, one a period, from rest to rest.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (k, n).
        qdot: Velocities in [rad/s] or [m/s], 0 at both ends. Shape (k, n).
        qddot: Accelerations in [rad/s²] or [m/s²], 0 at the end. Shape (k, n).
    """

    q: FloatArray
    qdot: FloatArray
    qddot: FloatArray


def smooth(q: FloatArray, dt: float, *, jerk: bool = False) -> Points:
    """Points between which a cubic Hermite spline accelerates at most 1.1 times as hard as the motion.

    The first of these that does: points through the coordinates themselves, which suit gradual accelerations; points of
    the cubic B-spline that has the coordinates as its control points, within q̈ Δt² / 6 of them; the same for a motion
    whose velocity jumps at the start, caught up with from rest, within 4 q̈ Δt²; else, after a wait of one period.

    Args:
        q: Joint coordinates, one row a period, from rest; the last two are equal. Shape (k, n).
        dt: The period in [s].
        jerk: Whether jerk is limited: then the last of them. A cubic B-spline has continuous accelerations, also at
            both ends, and at each time keeps the limits of velocity, acceleration and jerk that its control points keep
            from step to step.
    """
    waited = _points(np.vstack([q[:1], q]), dt, smoothed=True)
    if jerk:
        return waited
    played = np.abs(np.diff(q, 2, axis=0, prepend=q[:1])).max(axis=0) / dt**2
    most = EXCESS * np.maximum(played, FLOOR * played.max())
    for points in (_points(q, dt), _points(q, dt, smoothed=True), _points(q + from_rest(q), dt, smoothed=True)):
        if (accelerations(points, dt) <= most).all():
            return points
    return waited


def from_rest(q: FloatArray) -> FloatArray:
    """A correction that removes the initial velocity of a motion, back at 0 within some periods. Shape (k, n)."""
    if len(q) < 3:
        return np.zeros_like(q)
    jump = 0.5 * (-3.0 * q[0] + 4.0 * q[1] - q[2])  # in one period
    return -np.outer(np.arange(len(q)) * (1.0 - _progress(len(q))) ** 2, jump)


def accelerations(points: Points, dt: float) -> FloatArray:
    """The largest accelerations of the cubic Hermite spline of some points, in [rad/s²] or [m/s²]. Shape (n,)."""
    slope, first, last = np.diff(points.q, axis=0) / dt, points.qdot[:-1], points.qdot[1:]
    ends = (6.0 * slope - 4.0 * first - 2.0 * last, -6.0 * slope + 2.0 * first + 4.0 * last)
    peaks: FloatArray = np.abs(ends).max(axis=(0, 1)) / dt
    return peaks


def _points(q: FloatArray, dt: float, *, smoothed: bool = False) -> Points:
    """Points with central differences, at the coordinates or where the B-spline is, from the first coordinates on."""
    control = q
    if smoothed:
        fading = _fading(len(q))
        control = q - np.outer(fading, (q[1] - q[0]) / (2.0 + fading[1]))
    # The motion is continued as its mirror image before the start, and at rest after the end.
    padded = np.vstack([control[1:2], control, control[-1:]])
    bend = np.diff(padded, 2, axis=0)
    moved = control + bend / 6.0 if smoothed else q.copy()
    moved[0] = q[0]
    return Points(moved, (padded[2:] - padded[:-2]) / (2.0 * dt), bend / dt**2)


def _fading(count: int) -> FloatArray:
    """From 1 to 0, with slopes of 0 at both ends. Shape (count,)."""
    u = _progress(count)
    out: FloatArray = 1.0 - u**2 * (3.0 - 2.0 * u)
    return out


def _progress(count: int) -> FloatArray:
    """The share of :data:`CATCH_UP` that has passed, all of it before the last two rows. Shape (count,)."""
    return np.minimum(np.arange(count) / max(1, min(CATCH_UP, count - 2)), 1.0)


def stop(arm: Arm, q: FloatArray, dt: float, jerk_limit: FloatArray | None = None) -> FloatArray:
    """A motion that begins at rest, continued until it is at rest.

    With a limited jerk each joint stops as fast as it can. Without:

    All joints slow down together, along the line on which they move at the end, with accelerations that begin and end
    at 0. None slows down harder than it has accelerated before: a motion within acceleration limits stays there.

    Args:
        arm: The arm.
        q: Joint coordinates, one row a period, in [rad] or [m]. Shape (k, n).
        dt: The period in [s].
        jerk_limit: In [rad/s³] or [m/s³], inf where there is none. Shape (n,).

    Returns:
        The coordinates, followed by those of the stop; the last two rows are equal.

    Raises:
        InvalidInputError: A joint would pass its stop.
    """
    qdot = np.diff(q, axis=0) / dt
    last = qdot[-1]
    if not last.any():
        return q
    if jerk_limit is not None:
        slowing = _slowing(qdot, dt * arm.acceleration_limit, dt * dt * jerk_limit)
        return _append_stop(arm, q, dt, slowing)
    hardest = np.abs(np.diff(qdot, axis=0, prepend=np.zeros_like(q[:1]))).max(axis=0) / dt
    moving = last != 0.0
    periods = max(FEWEST, math.ceil(STEEPEST * (np.abs(last[moving]) / hardest[moving]).max() / dt))
    u = np.arange(1, periods + 1) / periods
    slowing = np.outer(1.0 - u**2 * (3.0 - 2.0 * u), last)
    return _append_stop(arm, q, dt, slowing)


def _slowing(qdot: FloatArray, most: FloatArray, steps: FloatArray) -> FloatArray:
    """Velocities of the fastest stop, see :func:`stopping_change`, until all are 0. Shape (k, n)."""
    velocity, change, out = qdot[-1].copy(), qdot[-1] - qdot[-2], []
    while velocity.any():
        for j in range(len(velocity)):
            change[j] = stopping_change(velocity[j], change[j], most[j], steps[j])
        velocity += change
        out.append(velocity.copy())
    return np.array(out)


def _append_stop(arm: Arm, q: FloatArray, dt: float, slowing: FloatArray) -> FloatArray:
    out = np.vstack([q, q[-1] + dt * np.cumsum(slowing, axis=0)])
    _check(arm, out[-1], (q[-1] - q[-2]) / dt)
    return out


def _check(arm: Arm, end: FloatArray, qdot: FloatArray) -> None:
    outside = (end < arm.lower) | (end > arm.upper)
    if outside.any():
        i = int(np.argmax(outside))
        unit = "m" if arm.prismatic[i] else "rad"
        raise InvalidInputError(
            f"expected a run that ends at rest, or where there is room to stop: joint {arm.joint_names[i]!r} moves at "
            f"{qdot[i]:.3g} {unit}/s at the end, and would stop at {end[i]:.4g} {unit}, beyond its limits "
            f"{arm.lower[i]:.4g} to {arm.upper[i]:.4g}; more steps after the path's end give it rest."
        )
