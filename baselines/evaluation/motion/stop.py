"""The stop of a motion that ends while joints move."""

from __future__ import annotations

import math

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray

#: Fewest periods of a stop.
FEWEST = 10
#: The largest slope of 3 u² − 2 u³.
STEEPEST = 1.5


def stopped(arm: Arm, q: FloatArray, dt: float) -> FloatArray:
    """A motion that begins at rest, continued until it is at rest.

    All joints slow down together, along the line on which they move at the end, with accelerations that begin and end
    at 0. None slows down harder than it has accelerated before: a motion within acceleration limits stays there.

    Args:
        arm: The arm.
        q: Joint coordinates, one row a period, in [rad] or [m]. Shape (k, n).
        dt: The period in [s].

    Returns:
        The coordinates, followed by those of the stop; the last two rows are equal.

    Raises:
        InvalidInputError: A joint would pass its stop.
    """
    qdot = np.diff(q, axis=0) / dt
    last = qdot[-1]
    if not last.any():
        return q
    hardest = np.abs(np.diff(qdot, axis=0, prepend=np.zeros_like(q[:1]))).max(axis=0) / dt
    moving = last != 0.0
    periods = max(FEWEST, math.ceil(STEEPEST * (np.abs(last[moving]) / hardest[moving]).max() / dt))
    u = np.arange(1, periods + 1) / periods
    slowing = np.outer(1.0 - u**2 * (3.0 - 2.0 * u), last)
    out = np.vstack([q, q[-1] + dt * np.cumsum(slowing, axis=0)])
    _check(arm, out[-1], last)
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
