"""A straight line."""

from __future__ import annotations

import dataclasses

import numpy as np

from ikgym.trajectories.paths.path import Path, points_of
from ikgym.validation import FloatArray, Vector


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
