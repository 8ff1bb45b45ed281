"""The base class of paths."""

from __future__ import annotations

import abc
from typing import Annotated

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.validation import LARGEST, FloatArray, frozen_array


class Path(Frozen, abc.ABC):
    """A curve in space without time: points as a function of the arc length s, from 0 to ``length``.

    Its direction is continuous, so that a tool can run along it without a stop.
    """

    #: The length of the path in [m].
    length: float
    #: The largest curvature in [1/m], 0 for a straight line.
    curvature: float

    @property
    def stations(self) -> FloatArray:
        """Arc lengths of the waypoints in [m]; start and end where there are no others. Shape (k,)."""
        return np.array([0.0, self.length])

    @abc.abstractmethod
    def along(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position and tangent of the path.

        Args:
            s: Arc lengths in [m], from 0 to ``length``. Shape (k,).

        Returns:
            Points in [m], and unit tangents. Shapes (k, 3).
        """


class Outline(Path):
    """A path that runs along another one."""

    #: The other path.
    outline: Path

    def __post_init__(self) -> None:
        super().__post_init__()
        outline = self._make_outline()
        self._settle(outline=outline, length=outline.length, curvature=outline.curvature)

    @abc.abstractmethod
    def _make_outline(self) -> Path:
        """The other path, from checked fields."""

    def along(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See :meth:`Path.along`."""
        return self.outline.along(s)


def points_of(name: str, value: npt.ArrayLike) -> FloatArray:
    """Two points or more, of which no two that follow each other are the same. Shape (k, 3)."""
    points = frozen_array(name, value, (None, 3), at_most=LARGEST)
    check_count(name, points)
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if (gaps < SHORTEST).any():
        i = int(np.argmin(gaps))
        raise InvalidInputError(
            f"{name}: expected points at least {SHORTEST:g} m apart, got {points[i].tolist()} and "
            f"{points[i + 1].tolist()} as numbers {i} and {i + 1}."
        )
    return points


def check_count(name: str, points: FloatArray) -> None:
    """Checks that there are at least 2 waypoints, and not too many."""
    if not 2 <= len(points) <= MOST_POINTS:
        raise InvalidInputError(f"{name}: expected from 2 to {MOST_POINTS} waypoints, got {len(points)}.")


#: Points of a path, as a field that is checked.
Points = Annotated[FloatArray, points_of]
#: Most waypoints: they are read and made into a path within 10 s.
MOST_POINTS = 200_000
#: Points that follow each other are at least this far apart, in [m].
SHORTEST = 1e-9
