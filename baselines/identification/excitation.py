"""A motion that excites the drives of an arm: all joints at once, at many frequencies, at rest at both ends."""

from __future__ import annotations

from typing import Any

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray, number

#: Period of the motion in [s]. Highest frequency in parts of the control rate, and how many
#: frequencies there are for each joint.
REPEAT, HIGHEST, SINES = 5.0, 0.4, 28
#: Draws of phases, of which those with the lowest peak of acceleration are taken.
DRAWS = 30
#: Seconds in which the motion fades in and out, and the amplitude of its first, gentle quarter.
FADE, GENTLE = 1.0, 0.25
#: Smallest distance of bodies in [m], and amplitudes that are tried until it is kept.
CLEARANCE, SMALLER = 0.02, (1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.1)


def excite(arm: Arm, seconds: float, period: float, share: float = 0.4, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """A motion around the arm's home that excites its drives.

    Sums of sines, other frequencies for each joint, whose accelerations are equal above 1.5 Hz; the first quarter is
    gentle, so that friction shows as a difference.

    Args:
        arm: The arm.
        seconds: Duration in [s].
        period: The control period in [s].
        share: Largest share of the limits of position around home, velocity, acceleration and jerk that is used.
        seed: Of the phases.

    Returns:
        Joint coordinates before each command, in [rad] or [m], and the commands in [rad/s] or [m/s]. Shapes (k, n).

    Raises:
        InvalidInputError: A number is out of its range, a velocity limit is missing, or no motion keeps the arm clear
            of itself.
    """
    number("seconds", seconds, at_least=5.0, at_most=120.0)
    number("share", share, at_least=0.01, at_most=0.9)
    highest = HIGHEST / number("period", period, at_least=5e-4, at_most=0.02)
    if not np.isfinite(arm.velocity_limit).all():
        raise InvalidInputError(f"expected an arm with limits of velocity, {arm.name} lacks them.")
    home: FloatArray = np.asarray(arm.home)
    n, k = arm.joints, round(seconds / period)
    t, rng = period * np.arange(k), np.random.default_rng(seed)
    multiples = np.geomspace(2.0, highest * REPEAT - n, SINES).round()[:, None] + np.arange(n)
    omega = 2.0 * np.pi / REPEAT * multiples
    size = 1.0 / np.sqrt(1.0 + (omega / (2.0 * np.pi * 1.5)) ** 2)
    phase = _calm_phases(omega, size * omega, rng, period)
    waves = (size[:, None] * np.sin(omega[:, None] * t[:, None] + phase[:, None])).sum(axis=0)
    gentle, end = 0.25 * seconds, seconds - FADE
    envelope = np.interp(t, [0.0, FADE, gentle, gentle + FADE], [0.0, GENTLE, GENTLE, 1.0])
    envelope *= np.interp(t, [end - FADE, end], [1.0, 0.0])
    qdot = envelope[:, None] * waves
    within = envelope * np.minimum(1.0, envelope)
    qdot -= within[:, None] * (qdot.sum(axis=0) / within.sum())  # ends where it began
    acceleration = np.where(np.isfinite(arm.acceleration_limit), arm.acceleration_limit, 4.0 * arm.velocity_limit)
    travel = np.abs(np.cumsum(qdot, axis=0)).max(axis=0) * period
    room = np.minimum(arm.upper - home, home - arm.lower)
    room = np.where(np.isfinite(room), room, np.pi)
    jerk = np.diff(np.pad(qdot, ((2, 2), (0, 0))), n=2, axis=0) / period**2
    most = np.array([
        arm.velocity_limit / np.abs(qdot).max(axis=0),
        acceleration / (np.abs(np.diff(qdot, axis=0)).max(axis=0) / period),
        arm.jerk_limit / np.abs(jerk).max(axis=0),
        room / travel,
    ])  # fmt: skip
    qdot *= share * most.min(axis=0)
    for smaller in SMALLER:
        command = smaller * qdot
        q = home + period * np.concatenate([np.zeros((1, n)), np.cumsum(command, axis=0)[:-1]])
        if _clear(arm, q[:: max(1, round(0.01 / period))]):
            return q, command
    raise InvalidInputError(f"expected a motion of {arm.name} around its home that touches nothing, found none.")


def _calm_phases(omega: FloatArray, size: FloatArray, rng: np.random.Generator, period: float) -> FloatArray:
    """Phases of sines with the lowest peak of their sum that some draws find. Shapes (s, n)."""
    t = np.arange(0.0, REPEAT, period)[:, None]
    best, lowest = np.zeros_like(omega), np.full(omega.shape[1], np.inf)
    for _ in range(DRAWS):
        phase = rng.uniform(0.0, 2.0 * np.pi, omega.shape)
        peak = np.abs((size[:, None] * np.cos(omega[:, None] * t + phase[:, None])).sum(axis=0)).max(axis=0)
        best, lowest = np.where(peak < lowest, phase, best), np.minimum(peak, lowest)
    return best


def _clear(arm: Arm, q: FloatArray) -> bool:
    """Whether no bodies come near each other; those that are near at home may stay so."""
    if not len(arm.bodies) or arm.bodies.unseen:
        return True
    distance: Any = arm.clearance(q)[0]
    return bool(distance.min() >= min(CLEARANCE, 0.9 * distance[0]))
