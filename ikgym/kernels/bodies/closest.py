"""Kernel: the closest pair of bodies and obstacles, with the points where it is closest."""

from __future__ import annotations

import numpy as np

from ikgym.kernels.bodies import of_bodies, of_obstacle, place, smallest
from ikgym.kernels.jit import kernel


@kernel
def closest_rows(chain, shapes, boxes, checked, q, distances, pairs, points, placed):
    """Bodies and their closest pair in N configurations.

    Args:
        chain: The arm, a :class:`ikgym.kernels.kinematics.Chain`.
        shapes: Its :class:`ikgym.kernels.bodies.Shapes`.
        boxes: The obstacles in each configuration, or once for all. Shape (N, o, 16) or (1, o, 16).
        checked: Whether a body may not touch an obstacle. Shape (o, k).
        q: Joint coordinates in [rad] or [m]. Shape (N, n).
        distances: Receives the smallest signed distances in [m]. Shape (N,).
        pairs: Receives the pairs, see :func:`ikgym.kernels.bodies.smallest`; -1 where nothing can meet. Shape (N, 2).
        points: Receives the closest points of the first and the second of the pair in [m]. Shape (N, 2, 3).
        placed: Receives start, end and middle of each body in [m]. Shape (N, k, 9).
    """
    joints, core, bodies = np.empty((q.shape[1], 6)), np.empty(6), shapes.links.shape[0]
    for row in range(q.shape[0]):
        around = boxes[min(row, boxes.shape[0] - 1)]
        place(chain, shapes, q[row], joints, placed[row])
        pairs[row, 0] = pairs[row, 1] = -1
        distances[row] = smallest(shapes, around, checked, placed[row], core, pairs[row])
        first, second = pairs[row, 0], pairs[row, 1]
        if first < 0:
            points[row] = np.nan
            continue
        if second < bodies:
            distance, nx, ny, nz, x, y, z = of_bodies(shapes, placed[row], first, second)
        else:
            distance, nx, ny, nz, x, y, z = of_obstacle(shapes, placed[row], first, around[second - bodies], core)
        for end in range(2):
            back = shapes.radii[first] + end * distance
            points[row, end, 0], points[row, end, 1], points[row, end, 2] = x - back * nx, y - back * ny, z - back * nz
