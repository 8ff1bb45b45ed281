"""Kernels of bodies and obstacles: where they are, and how far from each other."""

from __future__ import annotations

from ikgym.kernels.bodies.clearance import (
    clearance_rows,
    closest_rows,
    gradient,
    near_rows,
    nearest,
    of_bodies,
    of_obstacle,
    smallest,
)
from ikgym.kernels.bodies.placing import PLACED, Floats, Integers, Shapes, Surroundings, place
from ikgym.kernels.outcome import OBSTACLE

__all__ = [
    "OBSTACLE",
    "PLACED",
    "Floats",
    "Integers",
    "Shapes",
    "Surroundings",
    "clearance_rows",
    "closest_rows",
    "gradient",
    "near_rows",
    "nearest",
    "of_bodies",
    "of_obstacle",
    "place",
    "smallest",
]
