"""Capsules around solids: exact for spheres and capsules, and with some volume more for all others."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ikgym.exceptions import MissingDependencyError
from ikgym.validation import FloatArray

# Most capsules side by side in a box.
MOST = 4
# Capsules that a search around points tries from each of their principal axes, and how many points it looks at: a fine
# mesh of a round body has 100,000 corners on its hull.
TRIALS, POINTS = 1500, 1000


class Capsule(NamedTuple):
    """All that is within a radius of a segment.

    Attributes:
        start: One end of the segment in [m]. Shape (3,).
        end: The other end in [m]. Shape (3,).
        radius: In [m].
    """

    start: FloatArray
    end: FloatArray
    radius: float

    @property
    def volume(self) -> float:
        """In [m³]."""
        return _volume(float(np.linalg.norm(self.end - self.start)), self.radius)

    def contains(self, other: Capsule, tolerance: float = 1e-6) -> bool:
        """Whether another capsule sticks out by no more than the tolerance in [m]."""
        ends = np.array([other.start, other.end])
        return bool((distances(ends, self.start, self.end) + other.radius <= self.radius + tolerance).all())


def along(axis: int, length: float, radius: float) -> Capsule:
    """A capsule in the middle of the frame along one of its axes, by its number; lengths in [m]."""
    end = 0.5 * length * np.eye(3)[axis]
    return Capsule(-end, end, radius)


def around_box(size: tuple[float, ...]) -> list[Capsule]:
    """Capsules along the longest edge of a box, side by side where it is flat; a sphere where that is smaller."""
    thin, wide, long = np.argsort(size, kind="stable").tolist()
    count = min(MOST, round(size[wide] / size[thin]))
    strip = size[wide] / count
    rod = along(long, size[long], 0.5 * math.hypot(strip, size[thin]))
    sphere = along(long, 0.0, 0.5 * math.hypot(*size))
    if sphere.volume < count * rod.volume:
        return [sphere]
    shifts = [(0.5 * (1 - count) + i) * strip * np.eye(3)[wide] for i in range(count)]
    return [Capsule(rod.start + shift, rod.end + shift, rod.radius) for shift in shifts]


def around(points: FloatArray) -> Capsule:
    """A capsule around points (p, 3) in [m], the smallest that a search finds from each of their principal axes."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    some = points[:: -(-len(points) // POINTS)]
    ends = min((_search(some, axis) for axis in axes), key=lambda ends: _cost(ends, points))
    return Capsule(ends[:3], ends[3:], float(distances(points, ends[:3], ends[3:]).max()))


def distances(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distances of points from a segment in [m]. Shapes (p, 3) and (3,); result (p,)."""
    segment = end - start
    share = np.clip((points - start) @ segment / max(float(segment @ segment), 1e-300), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - share[:, None] * segment, axis=1))


def _search(points: FloatArray, axis: FloatArray) -> FloatArray:
    """Both ends of a small capsule, sought from one through the middle along an axis. Shape (6,)."""
    try:
        from scipy.optimize import minimize
    except ImportError as error:
        raise MissingDependencyError('Capsules around meshes need SciPy: pip install "ikgym[urdf]"') from error
    middle, size = points.mean(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-9)
    heights = (points - middle) @ axis
    first = np.concatenate([middle + 0.7 * height * axis for height in (heights.min(), heights.max())])
    corners = np.vstack([first, first + 0.1 * size * np.eye(6)])
    options = {"initial_simplex": corners, "maxfev": TRIALS, "xatol": 1e-4 * size, "fatol": 1e-5 * size**3}
    return np.asarray(minimize(_cost, first, args=(points,), method="Nelder-Mead", options=options).x)


def _cost(ends: FloatArray, points: FloatArray) -> float:
    start, end = ends[:3], ends[3:]
    return _volume(float(np.linalg.norm(end - start)), float(distances(points, start, end).max()))


def _volume(length: float, radius: float) -> float:
    return math.pi * radius**2 * (length + 4.0 / 3.0 * radius)
