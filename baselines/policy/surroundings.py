"""Bodies and obstacles of a problem, as solvers hand them to their kernels."""

from __future__ import annotations

import numpy as np

from baselines.policy.problem import Problem
from ikgym.arms import Arm
from ikgym.kernels.bodies import Shapes
from ikgym.plant.sweep import sweep
from ikgym.validation import LARGEST, BoolArray, FloatArray


def surroundings_of(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """The bodies of a problem, see :func:`bodies_block`, and the obstacles at the start of an episode.

    There are none where touching does not matter. Shapes (any,), (1, o, 16).
    """
    bodies, known = problem.model.bodies, problem.surroundings
    boxes, checked = bodies.surroundings(()) if known is None else known
    return bodies_block(bodies.shapes, checked), boxes[None].copy()


def bodies_block(shapes: Shapes, checked: BoolArray) -> FloatArray:
    """Bodies, and which may not touch which obstacle, (o, k), in one block: an array costs a call 0.15 µs."""
    counts = [len(shapes.links), len(shapes.pairs), len(checked)]
    return np.concatenate([counts, *map(np.ravel, shapes), checked.ravel()]).astype(np.float64)


def sweep_bodies(arm: Arm) -> FloatArray:
    """How far each joint of an arm moves each body at most within the limits, in [m] per unit. Shape (k, n)."""
    travel = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    return sweep(arm, np.where(arm.prismatic, np.minimum(travel, LARGEST), 0.0), 0.0)
