"""Bodies and obstacles as outlines, with the closest pair, in the picture of an arm."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ikgym.arms import Arm
from ikgym.kernels.bodies import Surroundings
from ikgym.obstacles.solids import bounded, closest, in_space, outline
from ikgym.rendering.style import BLUE, INK
from ikgym.validation import FloatArray


class SolidLines:
    """The lines of bodies, obstacles and the closest pair; `line` makes one in space, from its name and its style."""

    def __init__(self, arm: Arm, surroundings: Surroundings, line: Callable[..., Any]) -> None:
        self._arm, self._surroundings = arm, surroundings
        self._view = np.zeros(3), arm.reach(np.zeros(arm.joints))
        thin: dict[str, Any] = {"lw": 0.7, "alpha": 0.55}
        self._obstacles = line("obstacles", color=INK, **thin) if len(surroundings.boxes) else None
        self._bodies = line("bodies", color=BLUE, **thin)
        self._pair = line("closest pair", color=INK, lw=1.2, marker=".", ms=4)
        #: The lines that are there.
        self.lines = [one for one in (self._obstacles, self._bodies, self._pair) if one is not None]

    def extent(self, boxes: FloatArray | None) -> FloatArray:
        """Points of obstacles that the picture has to show in [m], within reach. Shape (k, 3)."""
        boxes = self._surroundings.boxes if boxes is None else boxes
        points = _outlines(boxes[boxes[:, 12] >= 0.0])
        return np.clip(points[np.isfinite(points[:, 0])], -self._view[1], self._view[1])

    def look(self, low: FloatArray, high: FloatArray) -> None:
        """Says which box in [m] the picture shows; half-spaces are squares in it. Shapes (3,)."""
        self._view = 0.5 * (low + high), 0.5 * float((high - low).max())

    def show(self, q: FloatArray, boxes: FloatArray | None) -> float:
        """Moves the lines; returns the distance of the closest pair in [m], infinite where there is none."""
        boxes = self._surroundings.boxes if boxes is None else boxes
        found = closest(self._arm, q[None], boxes[None], self._surroundings.checked)
        if self._obstacles is not None:
            centre, edge = self._view
            self._obstacles.set_data_3d(_outlines(bounded(boxes, edge, centre)).T)
        self._bodies.set_data_3d(_outlines(found.bodies[0]).T)
        self._pair.set_data_3d(found.points[0].T)
        return float(found.distances[0])


def _outlines(solids: FloatArray) -> FloatArray:
    """The outlines of solids in the base frame in [m], with gaps between them. Shape (k, 3)."""
    return np.vstack([np.empty((0, 3)), *(in_space(one, outline(one[12:])) for one in solids)])
