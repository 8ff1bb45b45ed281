"""What pictures of an arm show, links, bodies, obstacles and the target at one time, and the style of all of them."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np

from ikgym.kernels.rotations import geodesic_angle
from ikgym.obstacles.solids import Closest, closest
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

MOST_POINTS = 1000  # of a curve, more than its pixels resolve

# The colour-blind-safe palette of Okabe and Ito, and greys.
BLUE, ORANGE, VERMILION, GREEN = "#0072B2", "#E69F00", "#D55E00", "#009E73"
PALE_GREEN, PURPLE = "#97d8c4", "#CC79A7"
INK, STEEL, MIST, PALE = "#222222", "#808080", "#d9d9d9", "#f7f7f7"
SMALL, MEDIUM, LARGE = 8.5, 9.5, 11.0  # letters, in [pt]


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """An arm, its surroundings and its target at one time: what the renderer, videos and the viewer draw.

    Args:
        scenario: The scenario.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        target: The reference: rotation, row by row, and position in [m]; or the position alone. Shape (12,) or (3,).
        obstacles: The obstacles, see :class:`ikgym.kernels.bodies.Surroundings`. Shape (o, 16).
    """

    scenario: Scenario
    q: FloatArray
    target: FloatArray
    obstacles: FloatArray

    @functools.cached_property
    def tool(self) -> tuple[FloatArray, FloatArray]:
        """Rotation and position of the tool in [m]. Shapes (3, 3) and (3,)."""
        return self.scenario.arm.forward(self.q)

    @property
    def joints(self) -> FloatArray:
        """The two ends of each joint in [m]. Shape (n, 2, 3)."""
        return self.scenario.arm.joint_points(self.q)

    @functools.cached_property
    def closest(self) -> Closest:
        """The bodies, and the closest pair of them and of obstacles."""
        return closest(self.scenario.arm, self.q[None], self.obstacles[None], self.scenario.surroundings.checked)

    @property
    def clearance(self) -> float:
        """The distance of the closest pair in [m]; infinite where touching does not matter."""
        return float(self.closest.distances[0]) if self.scenario.collides else math.inf

    @property
    def errors(self) -> tuple[float, float]:
        """Distance in [m] and angle in [rad] of the tool from the target; NaN where the task has no orientation."""
        rotation, position = self.tool
        oriented = self.scenario.task.has_orientation
        angle = float(geodesic_angle(self.target[:9].reshape(3, 3), rotation)) if oriented else math.nan
        return float(np.linalg.norm(self.target[-3:] - position)), angle


def stride(points: int) -> int:
    """The number of points from one drawn point to the next."""
    return -(-points // MOST_POINTS)


def thin(points: FloatArray, step: int) -> FloatArray:
    """Each step-th point, and the last."""
    return np.concatenate([points[:-1:step], points[-1:]])
