"""A smooth curve through points."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.trajectories.paths.path import Path, Points
from ikgym.trajectories.splines import ArcLength, CubicSpline
from ikgym.validation import FloatArray

# Pieces of each interval for its length, and for its largest curvature and its least speed.
PIECES, SAMPLES = 8, 128
# The speed of the curve by its parameter is about 1; one that turns back where it came from stops on the way.
LEAST_SPEED = 0.02


@dataclasses.dataclass(frozen=True, eq=False)
class SplinePath(Path):
    """A cubic spline through points, its parameter the length of the chords, with curvature 0 at its ends.

    Args:
        points: In [m]. Shape (k, 3).

    Raises:
        InvalidInputError: There are fewer than two points, two that follow each other are the same, or the curve
            would turn straight back; the message says where.
    """

    points: Points

    def __post_init__(self) -> None:
        super().__post_init__()
        least, i, curvature = self._spline.extremes(SAMPLES)
        if least < LEAST_SPEED:
            raise InvalidInputError(
                f"points: expected a curve that nowhere turns straight back, got one that does near number {i}, "
                f"{self.points[i].tolist()}."
            )
        # The largest curvature of 128 samples between two points.
        self._settle(length=float(self._arc.lengths[-1]), curvature=curvature)

    @property
    def stations(self) -> FloatArray:
        """See :attr:`Path.stations`."""
        return self._arc.lengths[::PIECES]

    def along(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See :meth:`Path.along`."""
        u = self._arc.parameter(s)
        tangents = self._spline(u, 1)
        return self._spline(u), tangents / np.linalg.norm(tangents, axis=1)[:, None]

    @functools.cached_property
    def _spline(self) -> CubicSpline:
        chords = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return CubicSpline.through(np.concatenate([[0.0], np.cumsum(chords)]), self.points, at_rest=False)

    @functools.cached_property
    def _arc(self) -> ArcLength:
        spline = self._spline
        return ArcLength(lambda u: np.linalg.norm(spline(u, 1), axis=-1), _refine(spline.knots, PIECES))


def _refine(knots: FloatArray, pieces: int) -> FloatArray:
    """The same knots with ``pieces - 1`` more in between. Shape ((k - 1) pieces + 1,)."""
    at = np.arange((len(knots) - 1) * pieces + 1) / pieces
    return np.interp(at, np.arange(len(knots)), knots)
