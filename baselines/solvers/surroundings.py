"""Bodies and obstacles of a problem, as solvers hand them to their kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from baselines.policy import Problem
from ikgym.arms import Arm
from ikgym.kernels.bodies import Shapes
from ikgym.plant.sweep import sweep
from ikgym.validation import LARGEST, BoolArray, FloatArray


class Around(NamedTuple):
    """Bodies and obstacles, as arrays that a call from Python hands to a kernel.

    Attributes:
        bodies: See :func:`bodies_block`.
        boxes: The obstacles of each row, or those of all rows. Shape (B, o, 16) or (1, o, 16).
    """

    bodies: FloatArray
    boxes: FloatArray


def around(problem: Problem) -> Around:
    """The bodies of a problem, and the obstacles as they are at the start; none where touching does not matter."""
    bodies, known = problem.model.bodies, problem.surroundings
    boxes, checked = bodies.surroundings(()) if known is None else known
    return Around(bodies_block(bodies.shapes, checked), boxes[None].copy())


def bodies_block(shapes: Shapes, checked: BoolArray) -> FloatArray:
    """Bodies, and which may not touch which obstacle, (o, k), in one block: an array costs a call 0.15 µs."""
    counts = [len(shapes.links), len(shapes.pairs), len(checked)]
    return np.concatenate([counts, *map(np.ravel, shapes), checked.ravel()]).astype(np.float64)


def swept(arm: Arm) -> FloatArray:
    """How far each joint of an arm moves each body at most within the limits, in [m] per unit. Shape (k, n)."""
    travel = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    return sweep(arm, np.where(arm.prismatic, np.minimum(travel, LARGEST), 0.0), 0.0)
