"""Round paths: circle, helix and lemniscate."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np

from ikgym.trajectories.paths.path import Path
from ikgym.trajectories.splines import ArcLength
from ikgym.validation import FloatArray, Positive, Rotation, Signed, Vector


@dataclasses.dataclass(frozen=True, eq=False)
class CircularHelix(Path):
    """A helix, ``x = r cos φ, y = r sin φ, z = c φ / 2π`` in the frame of the path, from φ = 0.

    Args:
        center: Where the axis begins, in [m]. Shape (3,).
        radius: r in [m].
        pitch: c in [m] a turn, of either sign.
        turns: How often it goes around.
        rotation: Its columns are the directions of x, y and z. Shape (3, 3).

    Raises:
        InvalidInputError: A number is out of its range, or the rotation none.
    """

    center: Vector
    radius: Positive
    pitch: Signed
    turns: Positive = 1.0
    rotation: Rotation = dataclasses.field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle(length=2.0 * math.pi * self.turns * self._rate, curvature=self.radius / self._rate**2)

    def along(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See :meth:`Path.along`."""
        climb = self.pitch / (2.0 * math.pi)
        angle = s / self._rate
        x, y = self.radius * np.cos(angle), self.radius * np.sin(angle)
        points = np.column_stack([x, y, climb * angle]) @ self.rotation.T
        tangents = np.column_stack([-y, x, np.full(len(s), climb)]) @ self.rotation.T
        return self.center + points, tangents / self._rate

    @property
    def _rate(self) -> float:
        """The length of the path in [m] a radian, ds / dφ."""
        return math.hypot(self.radius, self.pitch / (2.0 * math.pi))


@dataclasses.dataclass(frozen=True, eq=False)
class Circle(CircularHelix):
    """A circle, ``x = r cos φ, y = r sin φ`` in the frame of the path, from φ = 0.

    Args:
        center: In [m]. Shape (3,).
        radius: r in [m].
        turns: How often it goes around; 0.5 is half a circle.
        rotation: Its columns are the directions of x and y, and the axis. Shape (3, 3).

    Raises:
        InvalidInputError: A number is out of its range, or the rotation none.
    """

    pitch: float = dataclasses.field(init=False, default=0.0)


@dataclasses.dataclass(frozen=True, eq=False)
class Lemniscate(Path):
    """Bernoulli's lemniscate, ``(x, y) = a cos φ (1, sin φ) / (1 + sin² φ)``, from its right end.

    Args:
        center: Where it crosses itself, in [m]. Shape (3,).
        radius: a, from the center to either end, in [m].
        rotation: Its columns are the directions of x and y, and the normal. Shape (3, 3).

    Raises:
        InvalidInputError: A number is out of its range, or the rotation none.
    """

    center: Vector
    radius: Positive
    rotation: Rotation = dataclasses.field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle(length=float(self._arc.lengths[-1]), curvature=3.0 / self.radius)  # that at both ends

    def along(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See :meth:`Path.along`."""
        angle = self._arc.parameter(s)
        sine, cosine = np.sin(angle), np.cos(angle)
        below = 1.0 + sine**2
        figure = np.column_stack([cosine, sine * cosine, np.zeros(len(s))]) * (self.radius / below)[:, None]
        # The derivative of (cos φ, sin φ cos φ) / (1 + sin² φ), whose length is 1 / sqrt(1 + sin² φ).
        tangents = np.column_stack([-sine * (3.0 - sine**2), 1.0 - 3.0 * sine**2, np.zeros(len(s))])
        tangents /= below[:, None] ** 1.5
        return self.center + figure @ self.rotation.T, tangents @ self.rotation.T

    @functools.cached_property
    def _arc(self) -> ArcLength:
        return ArcLength(lambda angle: self.radius / np.sqrt(1.0 + np.sin(angle) ** 2), np.linspace(0, 2 * np.pi, 65))
