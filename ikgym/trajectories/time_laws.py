"""Time laws: how fast a path is followed, from rest to rest."""

from __future__ import annotations

import abc
import dataclasses
import math

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.trajectories.paths import Path
from ikgym.validation import FloatArray, Positive


@dataclasses.dataclass(frozen=True)
class TimeLaw(Frozen, abc.ABC):
    """From rest to rest along a path, as fast as a speed and an acceleration allow, or slower.

    On a path that bends, the acceleration along it and the one across it get 1/√2 of the largest each, so that both
    together do not exceed it.

    Args:
        speed: Largest speed of the point, in [m/s].
        acceleration: Largest acceleration of the point, in [m/s²].
        duration: How long it takes, in [s]; as short as possible if left out.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    speed: Positive
    acceleration: Positive
    duration: Positive | None = None

    def time(self, path: Path) -> float:
        """Duration, in [s].

        Raises:
            InvalidInputError: The duration is too short for the speed and the acceleration.
        """
        shortest = self.shortest(path.length, *self._limits_along(path))
        if self.duration is None:
            return shortest
        if self.duration < shortest * (1.0 - 1e-12):
            raise InvalidInputError(
                f"duration: expected at least {shortest:.6g} s for a path of {path.length:.6g} m with the speed and "
                f"the acceleration given, got {self.duration:g} s."
            )
        return self.duration

    def travel(self, times: FloatArray, path: Path) -> FloatArray:
        """The arc length covered, in [m]: 0 until the time 0, and that of the whole path from the end on.

        Args:
            times: In [s]. Shape (k,).
            path: The path.
        """
        time = self.time(path)
        return self.cover(np.clip(times, 0.0, time), time, path.length, self._limits_along(path)[1])

    @abc.abstractmethod
    def shortest(self, length: float, speed: float, acceleration: float) -> float:
        """The shortest time for a length in [m], in [s]."""

    @abc.abstractmethod
    def cover(self, t: FloatArray, time: float, length: float, acceleration: float) -> FloatArray:
        """The arc length covered after t in [s], if the whole length in [m] takes ``time``."""

    def _limits_along(self, path: Path) -> tuple[float, float]:
        """The largest speed and acceleration along the path."""
        if path.curvature == 0.0:
            return self.speed, self.acceleration
        either = self.acceleration / math.sqrt(2.0)
        return min(self.speed, math.sqrt(either / path.curvature)), either


@dataclasses.dataclass(frozen=True)
class Quintic(TimeLaw):
    """A polynomial of fifth degree: speed and acceleration are continuous, and 0 at both ends. See :class:`TimeLaw`."""

    def shortest(self, length: float, speed: float, acceleration: float) -> float:
        """Its largest speed is 15/8 L/T, its largest acceleration 10/√3 L/T²."""
        return max(1.875 * length / speed, math.sqrt(10.0 / math.sqrt(3.0) * length / acceleration))

    def cover(self, t: FloatArray, time: float, length: float, acceleration: float) -> FloatArray:
        """See :meth:`TimeLaw.cover`."""
        u = t / time
        return np.minimum(length * u**3 * (10.0 + u * (6.0 * u - 15.0)), length)


@dataclasses.dataclass(frozen=True)
class Trapezoidal(TimeLaw):
    """Constant acceleration, constant speed, constant deceleration; no constant speed on a short path.

    See :class:`TimeLaw`.
    """

    def shortest(self, length: float, speed: float, acceleration: float) -> float:
        """See :meth:`TimeLaw.shortest`."""
        if length * acceleration <= speed**2:
            return 2.0 * math.sqrt(length / acceleration)
        return length / speed + speed / acceleration

    def cover(self, t: FloatArray, time: float, length: float, acceleration: float) -> FloatArray:
        """See :meth:`TimeLaw.cover`."""
        # The speed v that takes this time: T = L / v + v / a.
        half = 0.5 * acceleration * time
        speed = length * acceleration / (half + math.sqrt(max(half**2 - acceleration * length, 0.0)))
        ramp, left = speed / acceleration, time - t
        rising, falling = 0.5 * acceleration * t**2, length - 0.5 * acceleration * left**2
        cruising = speed * (t - 0.5 * ramp)
        return np.clip(np.where(t < ramp, rising, np.where(left < ramp, falling, cruising)), 0.0, length)


#: The time laws by their names in scenario files.
TIME_LAWS: dict[str, type[TimeLaw]] = {"quintic": Quintic, "trapezoidal": Trapezoidal}
