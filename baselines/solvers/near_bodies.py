"""Kernels: the pairs of bodies that are about to touch, as solvers of one step need them."""

from __future__ import annotations

import numpy as np

from ikgym.kernels.bodies import PLACED, Shapes, gradient, nearest, place
from ikgym.kernels.jit import inlined, kernel, uncounted

# Most pairs that are looked at, the nearest ones, and the most rows, two for each.
PAIRS = 12
ROWS = 2 * PAIRS
# Share of the distance of influence at which two bodies of the arm are looked at: they are always near each other.
SELF = 0.33
# A nearest point so close to the end of a body's core is that end, in [m].
AT_END = 1e-9
# A joint motion that changes a distance by less than this for a unit of joint motion is no way to change it, in [m].
LEVER = 0.1


@kernel
def bodies_of(block):
    """The :class:`Shapes` in a block of `baselines.policy.problem`, and the pairs that are checked."""
    k, pairs, obstacles = int(block[0]), int(block[1]), int(block[2])
    starts, ends, radii, sizes, two = 3 + k, 3 + 4 * k, 3 + 7 * k, 3 + 8 * k, 3 + 9 * k
    shapes = Shapes(
        block[3:starts].astype(np.int64),
        block[starts:ends].reshape(k, 3),
        block[ends:radii].reshape(k, 3),
        block[radii:sizes],
        block[sizes:two],
        block[two : two + 2 * pairs].astype(np.int64).reshape(pairs, 2),
    )
    return shapes, (block[two + 2 * pairs :] != 0.0).reshape(obstacles, k)


@kernel
def near_work(n, bodies):
    """Arrays that :func:`near_distances` works with, for n joints and a number of bodies."""
    near = np.empty(PAIRS), np.empty((PAIRS, 2), np.int64), np.empty((PAIRS, 6))
    return np.empty((n, 6)), np.empty((bodies, PLACED)), np.empty(6), near


@uncounted
def near_distances(chain, shapes, checked, boxes, q, within, work, distances, reaches, gradients):
    """Signed distances of the pairs that are nearer than some distance, the nearest first, and their gradients.

    A body whose nearest point is an end of its core has a second row: the distance of the other end from the plane
    through the nearest point of its partner, which is convex, and so behind it. Without that a body that comes down
    flat on a face would be held by one end, in the next step by the other.

    Args:
        chain: The arm.
        shapes: Its bodies, :class:`Shapes`.
        checked: Whether a body may not touch an obstacle. Shape (o, k).
        boxes: The obstacles. Shape (o, 16).
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        within: The distance in [m].
        work: See :func:`near_work`.
        distances: Receives signed distances in [m]. Shape (ROWS,).
        reaches: Receives the distances from which on they are looked at: ``within`` for obstacles, a share of it for
            two bodies of the arm. Shape (ROWS,).
        gradients: Receives their gradients. Shape (ROWS, at least n).

    Returns:
        How many there are.
    """
    joints, placed, core, near = work
    place(chain, shapes, q, joints, placed)
    found, count = nearest(shapes, boxes, checked, placed, core, within, near), 0
    for i in range(found):
        first, second, vector = near[1][i, 0], near[1][i, 1], near[2][i]
        reach = within if second >= placed.shape[0] else SELF * within
        for end in range(2):
            rise = _other_end(placed[first], vector) if end else 0.0
            if not 0.0 <= rise <= reach - near[0][i]:
                break
            distances[count], reaches[count] = near[0][i] + rise, reach
            gradient(chain.prismatic, shapes, joints, first, second, vector, gradients[count])
            count += 1
    return count


@inlined
def _other_end(body, vector):
    """Puts the other end of a body's core in the place of the nearest point, if that is an end, and no sphere's.

    Returns how much farther it is along the vector; else -1.
    """
    to_start, to_end, rise = 0.0, 0.0, 0.0
    for c in range(3):
        to_start = max(to_start, abs(vector[3 + c] - body[c]))
        to_end = max(to_end, abs(vector[3 + c] - body[3 + c]))
    if min(to_start, to_end) > AT_END or max(to_start, to_end) <= AT_END:
        return -1.0
    for c in range(3):
        other = body[3 + c] if to_start < to_end else body[c]
        rise += vector[c] * (other - vector[3 + c])
        vector[3 + c] = other
    return rise


@uncounted
def repel(distances, reaches, gradients, count, gain, velocity):
    """Adds joint velocities that lead away from near bodies, as a potential field does (Khatib 1986).

    Each pair asks for the joint motion that would take it out of the distance of influence d*, (d* - d) ∇d / ‖∇d‖²,
    weighted by (1 - d / d*)²: it sets in smoothly. ``gain`` is in [1/s], ``velocity`` (n,) in [rad/s] or [m/s]; for the
    others see :func:`near_distances`.
    """
    for i in range(count):
        square = LEVER * LEVER
        for j in range(velocity.shape[0]):
            square += gradients[i, j] * gradients[i, j]
        missing = reaches[i] - distances[i]
        weight = gain * min(missing / reaches[i], 1.0) ** 2 * missing / square
        for j in range(velocity.shape[0]):
            velocity[j] += weight * gradients[i, j]
