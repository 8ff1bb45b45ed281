"""Paths: curves in space without time, by their arc length."""

from __future__ import annotations

from ikgym.trajectories.paths.path import Path
from ikgym.trajectories.paths.polyline import Line, Polyline, Raster, Square
from ikgym.trajectories.paths.round import Circle, CircularHelix, Lemniscate
from ikgym.trajectories.paths.spline import SplinePath

__all__ = [
    "PATHS",
    "Circle",
    "CircularHelix",
    "Lemniscate",
    "Line",
    "Path",
    "Polyline",
    "Raster",
    "SplinePath",
    "Square",
]

#: The paths by their names in scenario files.
PATHS: dict[str, type[Path]] = {
    "line": Line,
    "circle": Circle,
    "helix": CircularHelix,
    "lemniscate": Lemniscate,
    "square": Square,
    "raster": Raster,
    "polyline": Polyline,
    "spline": SplinePath,
}
