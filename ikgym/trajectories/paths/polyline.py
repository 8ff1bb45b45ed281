"""Straight lines, and lines joined by arcs: through points nearly, around a square, in a raster."""

from __future__ import annotations

import dataclasses
import functools
from typing import Annotated, NamedTuple

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.trajectories.paths.path import MOST_POINTS, Outline, Path, Points, points_of
from ikgym.validation import Bounds, FloatArray, Positive, Rotation, Vector, number

# Corners that turn by less than this, in [rad], are none.
STRAIGHT = 1e-9


@dataclasses.dataclass(frozen=True, eq=False)
class Line(Path):
    """A straight line.

    Args:
        start: In [m]. Shape (3,).
        end: In [m]. Shape (3,).

    Raises:
        InvalidInputError: A shape is wrong, or both are the same.
    """

    start: Vector
    end: Vector

    def __post_init__(self) -> None:
        super().__post_init__()
        points_of("start and end", [self.start, self.end])
        self._settle(length=float(np.linalg.norm(self.end - self.start)), curvature=0.0)

    def along(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See :meth:`Path.along`."""
        share = (s / self.length)[:, None]
        direction = (self.end - self.start) / self.length
        return (1.0 - share) * self.start + share * self.end, np.tile(direction, (len(s), 1))


class Pieces(NamedTuple):
    """Lines and arcs that follow each other.

    Attributes:
        begin: Arc lengths at which they begin, and the whole length, in [m]. Shape (p + 1,).
        start: First points in [m]. Shape (p, 3).
        tangent: Directions at the first points. Shape (p, 3).
        normal: Directions to the centers of the arcs. Shape (p, 3).
        curvature: In [1/m], 0 for a line. Shape (p,).
        corner: Arc lengths in the middle of all corners in [m]. Shape (k - 2,).
    """

    begin: FloatArray
    start: FloatArray
    tangent: FloatArray
    normal: FloatArray
    curvature: FloatArray
    corner: FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class Polyline(Path):
    """Straight lines from point to point, with arcs in place of the corners: through the ends, near the others.

    Args:
        points: In [m]. Shape (k, 3).
        corner_radius: Radius of the arcs, in [m].

    Raises:
        InvalidInputError: There are fewer than two points, two that follow each other are the same, a corner turns
            back, or an arc does not fit in between the points around it; the message says which and how much does.
    """

    points: Points
    corner_radius: Positive

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_corners()
        self._settle(length=float(self._pieces.begin[-1]), curvature=float(self._pieces.curvature.max()))

    @property
    def stations(self) -> FloatArray:
        """The ends, and the middles of the arcs. See :attr:`Path.stations`."""
        return np.concatenate([[0.0], self._pieces.corner, [self.length]])

    def along(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See :meth:`Path.along`."""
        p = self._pieces
        i = np.clip(np.searchsorted(p.begin, s, side="right") - 1, 0, len(p.start) - 1)
        run = (s - p.begin[i])[:, None]
        angle = p.curvature[i][:, None] * run
        tangent, normal = p.tangent[i], p.normal[i]
        # sin(κ s) / κ and (1 - cos(κ s)) / κ, good for κ = 0 as well.
        half = np.sinc(angle / (2.0 * np.pi))
        ahead, aside = run * np.sinc(angle / np.pi), 0.5 * run * angle * half**2
        return p.start[i] + ahead * tangent + aside * normal, np.cos(angle) * tangent + np.sin(angle) * normal

    @functools.cached_property
    def _turns(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Lengths and directions of the sides; angles of the corners, and the length of a side that an arc takes."""
        sides = np.diff(self.points, axis=0)
        lengths = np.linalg.norm(sides, axis=1)
        directions = sides / lengths[:, None]
        before, after = directions[:-1], directions[1:]
        across = np.linalg.norm(np.cross(before, after), axis=1)
        angles = np.arctan2(across, np.sum(before * after, axis=1))
        angles[angles < STRAIGHT] = 0.0
        return lengths, directions, angles, self.corner_radius * np.tan(0.5 * angles)

    def _check_corners(self) -> None:
        lengths, _, angles, taken = self._turns
        if (angles > np.pi - 1e-6).any():
            i = int(np.argmax(angles)) + 1
            raise InvalidInputError(
                f"points: expected no corner that turns straight back, got one at number {i}, "
                f"{self.points[i].tolist()}; an arc cannot round it."
            )
        left = lengths - np.concatenate([[0.0], taken]) - np.concatenate([taken, [0.0]])
        if (left < -1e-12 * lengths).any():
            i = int(np.argmin(left))
            most = self.corner_radius * float(lengths[i] / (lengths[i] - left[i]))
            raise InvalidInputError(
                f"corner_radius: expected at most {most:.6g} m, so that the arcs fit between the points number {i} and "
                f"{i + 1}, got {self.corner_radius:g} m."
            )

    @functools.cached_property
    def _pieces(self) -> Pieces:
        lengths, directions, angles, taken = self._turns
        # In turn a line and the arc behind it; the last line has none, nor have corners that do not turn.
        before, after = np.concatenate([[0.0], taken]), np.concatenate([taken, [0.0]])
        bends = np.concatenate([angles * self.corner_radius, [0.0]])
        inward = np.zeros_like(directions)
        for i in np.flatnonzero(bends > 0.0):
            normal = directions[i + 1] - np.cos(angles[i]) * directions[i]
            inward[i] = normal / np.linalg.norm(normal)
        lines = self.points[:-1] + before[:, None] * directions
        arcs = self.points[1:] - after[:, None] * directions
        straight = np.maximum(lengths - before - after, 0.0)
        ends = np.concatenate([[0.0], np.cumsum(np.column_stack([straight, bends]))])
        kept = np.column_stack([np.ones(len(lines), dtype=bool), bends > 0.0]).ravel()
        curvature = np.column_stack([np.zeros(len(lines)), np.full(len(lines), 1.0 / self.corner_radius)])
        return Pieces(
            begin=np.append(ends[:-1][kept], ends[-1]),
            start=np.stack([lines, arcs], axis=1).reshape(-1, 3)[kept],
            tangent=np.repeat(directions, 2, axis=0)[kept],
            normal=np.stack([np.zeros_like(inward), inward], axis=1).reshape(-1, 3)[kept],
            curvature=curvature.ravel()[kept],
            corner=ends[1:-2:2] + 0.5 * bends[:-1],
        )


@dataclasses.dataclass(frozen=True, eq=False)
class Square(Outline):
    """Once around a square with rounded corners, from the middle of a side.

    Args:
        center: In [m]. Shape (3,).
        side: In [m].
        corner_radius: In [m], at most half of the side.
        rotation: Its columns are the directions of the sides, and the normal about which the path turns to the left.
            Shape (3, 3).

    Raises:
        InvalidInputError: A number is out of its range, or the rotation none.
    """

    center: Vector
    side: Positive
    corner_radius: Positive
    rotation: Rotation = dataclasses.field(default_factory=lambda: np.eye(3))

    def _make_outline(self) -> Polyline:
        number("corner_radius", self.corner_radius, at_most=0.5 * self.side)
        corners = np.array([[0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0], [0, -1, 0]])
        return Polyline(self.center + 0.5 * self.side * corners @ self.rotation.T, self.corner_radius)


@dataclasses.dataclass(frozen=True, eq=False)
class Raster(Outline):
    """To and fro over a rectangle, line by line, as a tool does that sweeps it.

    Args:
        center: Of the rectangle, in [m]. Shape (3,).
        width: Length of the lines, in [m].
        height: From the first line to the last, in [m].
        lines: How many.
        corner_radius: In [m], at most half of the distance of two lines and half of their length.
        rotation: Its columns are the direction of the first line, the direction in which the lines follow each other,
            and the normal. Shape (3, 3).

    Raises:
        InvalidInputError: A number is out of its range, or the rotation none.
    """

    center: Vector
    width: Positive
    height: Positive
    lines: Annotated[int, Bounds(at_least=2, at_most=MOST_POINTS // 2)]
    corner_radius: Positive
    rotation: Rotation = dataclasses.field(default_factory=lambda: np.eye(3))

    def _make_outline(self) -> Polyline:
        between = self.height / (self.lines - 1)
        number("corner_radius", self.corner_radius, at_most=0.5 * min(between, self.width))
        rows = np.repeat(np.linspace(-0.5, 0.5, self.lines) * self.height, 2)
        ends = np.resize([-0.5, 0.5, 0.5, -0.5], 2 * self.lines) * self.width
        corners = np.column_stack([ends, rows, np.zeros(2 * self.lines)])
        return Polyline(self.center + corners @ self.rotation.T, self.corner_radius)
