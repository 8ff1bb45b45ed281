"""Kernels: how far the bodies of an arm are from each other and from obstacles."""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels.bodies.placing import PLACED, place
from ikgym.kernels.bodies.segments import into_box, segment_box, segment_plane, segment_segment
from ikgym.kernels.jit import inlined, kernel, uncounted


@inlined
def _self_bound(shapes, placed, first, second):
    """A lower bound of the distance of two bodies: its square, and a length to subtract from its root."""
    x = placed[first, 6] - placed[second, 6]
    y = placed[first, 7] - placed[second, 7]
    z = placed[first, 8] - placed[second, 8]
    return x * x + y * y + z * z, shapes.sizes[first] + shapes.sizes[second]


@inlined
def _bound(shapes, placed, body, box):
    """Like :func:`_self_bound` for a body and a box; includes the penetration depth of the centre."""
    x, y, z = into_box(box, placed[body, 6], placed[body, 7], placed[body, 8])
    x, y, z = abs(x) - box[12], abs(y) - box[13], abs(z) - box[14]
    inside = min(max(x, y, z), 0.0)
    x, y, z = max(x, 0.0), max(y, 0.0), max(z, 0.0)
    return x * x + y * y + z * z, shapes.sizes[body] + box[15] - inside


@inlined
def _beyond(square, taken, within):
    """Whether a distance, the root of a square less a length, is at least as large as another one."""
    far = within + taken
    return far <= 0.0 or square >= far * far


@uncounted
def of_bodies(shapes, placed, first, second):
    """Signed distance of two placed bodies in [m], the unit vector to the first, and the nearest point of its core."""
    distance, nx, ny, nz, x, y, z = segment_segment(placed[first], placed[second])
    return distance - shapes.radii[first] - shapes.radii[second], nx, ny, nz, x, y, z


@uncounted
def of_obstacle(shapes, placed, body, box, core):
    """Signed distance of a placed body from an obstacle; see :func:`of_bodies`. ``core`` has shape (6,)."""
    if box[12] < 0.0:
        distance, nx, ny, nz, x, y, z = segment_plane(placed[body], box)
    elif box[12] == 0.0 and box[13] == 0.0:
        for c in range(3):
            core[c] = box[9 + c] - box[14] * box[3 * c + 2]
            core[3 + c] = box[9 + c] + box[14] * box[3 * c + 2]
        distance, nx, ny, nz, x, y, z = segment_segment(placed[body], core)
    else:
        distance, nx, ny, nz, x, y, z = segment_box(placed[body], box)
    return distance - shapes.radii[body] - box[15], nx, ny, nz, x, y, z


@uncounted
def smallest(shapes, boxes, checked, placed, core, found):
    """The smallest signed distance of placed bodies from each other and from obstacles, in [m]; inf if there is none.

    Args:
        shapes: The bodies, :class:`ikgym.kernels.bodies.Shapes`.
        boxes: The obstacles, see :class:`ikgym.kernels.bodies.Surroundings`. Shape (o, 16).
        checked: Whether a body may not touch an obstacle. Shape (o, k).
        placed: Result of :func:`ikgym.kernels.bodies.place`. Shape (k, 9).
        core: Worked with. Shape (6,).
        found: Receives the pair: a body, and another body or k plus the number of an obstacle. Shape (2,).
    """
    best, bodies = math.inf, shapes.links.shape[0]
    for pair in range(shapes.pairs.shape[0]):
        first, second = shapes.pairs[pair, 0], shapes.pairs[pair, 1]
        square, taken = _self_bound(shapes, placed, first, second)
        if _beyond(square, taken, best):
            continue
        distance = of_bodies(shapes, placed, first, second)[0]
        if distance < best:
            best, found[0], found[1] = distance, first, second
    for obstacle in range(boxes.shape[0]):
        box = boxes[obstacle]
        for body in range(bodies):
            if not checked[obstacle, body]:
                continue
            if box[12] >= 0.0:
                square, taken = _bound(shapes, placed, body, box)
                if _beyond(square, taken, best):
                    continue
            distance = of_obstacle(shapes, placed, body, box, core)[0]
            if distance < best:
                best, found[0], found[1] = distance, body, bodies + obstacle
    return best


@inlined
def _keep(found, first, second, count, near):
    """Sorts a pair in among those that are kept, the nearest first; the last one drops out."""
    distances, pairs, vectors = near
    place = min(count, distances.shape[0] - 1)
    while place > 0 and distances[place - 1] > found[0]:
        distances[place] = distances[place - 1]
        pairs[place, 0], pairs[place, 1] = pairs[place - 1, 0], pairs[place - 1, 1]
        for c in range(6):
            vectors[place, c] = vectors[place - 1, c]
        place -= 1
    distances[place], pairs[place, 0], pairs[place, 1] = found[0], first, second
    for c in range(6):
        vectors[place, c] = found[1 + c]


@uncounted
def nearest(shapes, boxes, checked, placed, core, within, near):
    """The pairs that are nearer than some distance in [m], the nearest first, and how many there are, at most c.

    ``near`` receives signed distances in [m], of shape (c,), of the c nearest pairs;
    pairs as in :func:`smallest`, of shape (c, 2); and unit vectors to the first body with the nearest point of its core
    in [m], of shape (c, 6). For the other arguments see :func:`smallest`.
    """
    distances, pairs = near[0], shapes.pairs
    count, most, bodies = 0, distances.shape[0], shapes.links.shape[0]
    for pair in range(pairs.shape[0]):
        first, second = pairs[pair, 0], pairs[pair, 1]
        limit = within if count < most else min(within, distances[most - 1])
        square, taken = _self_bound(shapes, placed, first, second)
        if _beyond(square, taken, limit):
            continue
        found = of_bodies(shapes, placed, first, second)
        if found[0] < limit:
            _keep(found, first, second, count, near)
            count = min(count + 1, most)
    for obstacle in range(boxes.shape[0]):
        box = boxes[obstacle]
        for body in range(bodies):
            if not checked[obstacle, body]:
                continue
            limit = within if count < most else min(within, distances[most - 1])
            if box[12] >= 0.0:
                square, taken = _bound(shapes, placed, body, box)
                if _beyond(square, taken, limit):
                    continue
            found = of_obstacle(shapes, placed, body, box, core)
            if found[0] < limit:
                _keep(found, body, bodies + obstacle, count, near)
                count = min(count + 1, most)
    return count


@uncounted
def gradient(prismatic, shapes, joints, first, second, vector, out):
    """The gradient of the signed distance of a pair by the joints, in [m] per unit of joint coordinate.

    The distance has kinks, where the nearest points jump and this is the gradient on one side: parallel segments, a
    segment along an edge or a face of a box or of a half-space, one as deep in a box by two of its faces or edges, and
    cores that cross.

    Args:
        prismatic: True where a joint is prismatic. Shape (n,).
        shapes: The bodies, :class:`ikgym.kernels.bodies.Shapes`.
        joints: Axes and points of the joints, see :func:`ikgym.kernels.bodies.place`. Shape (n, 6).
        first: A body.
        second: Another body, or k plus the number of an obstacle.
        vector: Unit vector to the first body, and the nearest point of its core in [m]. Shape (6,).
        out: Receives the gradient; joints that move both bodies or none have 0. Shape (at least n,).
    """
    links = shapes.links
    until, since = links[first], links[second] if second < links.shape[0] else 0
    for j in range(joints.shape[0]):
        out[j] = 0.0
        if not since <= j < until:
            continue
        ax, ay, az = joints[j, 0], joints[j, 1], joints[j, 2]
        if not prismatic[j]:
            x, y, z = vector[3] - joints[j, 3], vector[4] - joints[j, 4], vector[5] - joints[j, 5]
            ax, ay, az = ay * z - az * y, az * x - ax * z, ax * y - ay * x
        out[j] = vector[0] * ax + vector[1] * ay + vector[2] * az


@kernel
def clearance_rows(chain, shapes, boxes, checked, q, distances, pairs):
    """The smallest signed distance of N configurations: ``q`` (N, n), ``distances`` (N,) in [m], ``pairs`` (N, 2)."""
    joints, placed = np.empty((q.shape[1], 6)), np.empty((shapes.links.shape[0], PLACED))
    core = np.empty(6)
    for row in range(q.shape[0]):
        place(chain, shapes, q[row], joints, placed)
        pairs[row, 0] = pairs[row, 1] = -1
        distances[row] = smallest(shapes, boxes, checked, placed, core, pairs[row])


@kernel
def closest_rows(chain, shapes, boxes, checked, q, distances, pairs, points, placed):
    """Bodies and their closest pair in N configurations.

    ``distances`` (N,), ``pairs`` (N, 2) and ``placed`` (N, k, 9) as above; ``points`` (N, 2, 3) are the closest ones of
    the pair in [m]. ``boxes`` are those of each configuration, (N, o, 16), or (1, o, 16).
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


@kernel
def near_rows(chain, shapes, boxes, checked, q, within, counts, distances, pairs, gradients):
    """The pairs nearer than ``within`` of N configurations, see :func:`nearest`, and the gradients of their distances.

    ``q`` has shape (N, n), ``counts`` (N,), ``distances`` (N, c), ``pairs`` (N, c, 2), ``gradients`` (N, c, n).
    """
    joints, placed = np.empty((q.shape[1], 6)), np.empty((shapes.links.shape[0], PLACED))
    core, vectors = np.empty(6), np.empty((distances.shape[1], 6))
    for row in range(q.shape[0]):
        place(chain, shapes, q[row], joints, placed)
        near = (distances[row], pairs[row], vectors)
        counts[row] = nearest(shapes, boxes, checked, placed, core, within, near)
        for i in range(counts[row]):
            first, second = pairs[row, i, 0], pairs[row, i, 1]
            gradient(chain.prismatic, shapes, joints, first, second, vectors[i], gradients[row, i])
