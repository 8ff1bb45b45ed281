"""Obstacles: spheres, capsules, boxes and half-spaces around an arm, at rest, moving, or drawn with the episode."""

from __future__ import annotations

from ikgym.obstacles.obstacle import Box, Capsule, HalfSpace, Obstacle, Sphere
from ikgym.obstacles.random_boxes import RandomBoxes

__all__ = ["KINDS", "MOST_OBSTACLES", "Box", "Capsule", "HalfSpace", "Obstacle", "RandomBoxes", "Sphere"]

#: Most obstacles of a scenario.
MOST_OBSTACLES = 1000
#: The kinds of obstacles by their names in scenario files.
KINDS: dict[str, type[Obstacle]] = {
    "sphere": Sphere,
    "capsule": Capsule,
    "box": Box,
    "half_space": HalfSpace,
    "random_boxes": RandomBoxes,
}
