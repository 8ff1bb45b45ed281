"""Kernels: where the bodies of an arm are, and how far they are from each other and from obstacles."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.jit import inlined, kernel, uncounted
from ikgym.kernels.outcome import OBSTACLE as OBSTACLE
from ikgym.kernels.segments import into_box, segment_box, segment_plane, segment_segment

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

# Numbers of a placed body: start, end, middle.
PLACED = 9


class Shapes(NamedTuple):
    """The bodies of an arm as kernels see them, sorted by link.

    Attributes:
        links: Link of each body: 0 is the base, i the link behind joint i. Shape (k,).
        starts: In the frame of the link, in [m]. Shape (k, 3).
        ends: In the frame of the link, in [m]. Shape (k, 3).
        radii: In [m]. Shape (k,).
        sizes: Radii of spheres around the middle of each body that contain it, in [m]. Shape (k,).
        pairs: Bodies that can meet: the one on the later link, then the other. Shape (p, 2).
    """

    links: Integers
    starts: Floats
    ends: Floats
    radii: Floats
    sizes: Floats
    pairs: Integers


class Surroundings(NamedTuple):
    """Obstacles as kernels see them: boxes with rounded edges.

    Attributes:
        boxes: Rotation row by row, position in [m], half of the edges in [m], radius in [m]. A sphere has no edges, a
            capsule one along its third axis; the edges of a half-space are negative, its face is where the position is,
            and its third axis points out of it. Shape (o, 16).
        checked: Whether a body may not touch an obstacle. Shape (o, k).
    """

    boxes: Floats
    checked: npt.NDArray[np.bool_]


@uncounted
def place(chain, shapes, q, joints, placed):
    """Goes along the chain and leaves where joints and bodies are, in the base frame.

    Args:
        chain: The arm, a :class:`ikgym.kernels.kinematics.Chain`.
        shapes: Its :class:`Shapes`.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        joints: Receives the axis of each joint, and its point in [m]. Shape (n, 6).
        placed: Receives start, end and middle of each body in [m]. Shape (k, 9).
    """
    offsets, axes, prismatic, links = chain.offsets, chain.axes, chain.prismatic, shapes.links
    r00, r01, r02 = 1.0, 0.0, 0.0
    r10, r11, r12 = 0.0, 1.0, 0.0
    r20, r21, r22 = 0.0, 0.0, 1.0
    px, py, pz = 0.0, 0.0, 0.0
    body, bodies = 0, links.shape[0]
    for i in range(q.shape[0] + 1):
        while body < bodies and links[body] == i:
            for end in range(2):
                points = shapes.starts if end == 0 else shapes.ends
                x, y, z = points[body, 0], points[body, 1], points[body, 2]
                placed[body, 3 * end] = px + r00 * x + r01 * y + r02 * z
                placed[body, 3 * end + 1] = py + r10 * x + r11 * y + r12 * z
                placed[body, 3 * end + 2] = pz + r20 * x + r21 * y + r22 * z
            for c in range(3):
                placed[body, 6 + c] = 0.5 * (placed[body, c] + placed[body, 3 + c])
            body += 1
        if i == q.shape[0]:
            break
        ox, oy, oz = offsets[i, 0], offsets[i, 1], offsets[i, 2]
        ax, ay, az = axes[i, 0], axes[i, 1], axes[i, 2]
        if prismatic[i]:
            ox, oy, oz = ox + q[i] * ax, oy + q[i] * ay, oz + q[i] * az
        px += r00 * ox + r01 * oy + r02 * oz
        py += r10 * ox + r11 * oy + r12 * oz
        pz += r20 * ox + r21 * oy + r22 * oz
        joints[i, 0] = r00 * ax + r01 * ay + r02 * az
        joints[i, 1] = r10 * ax + r11 * ay + r12 * az
        joints[i, 2] = r20 * ax + r21 * ay + r22 * az
        joints[i, 3], joints[i, 4], joints[i, 5] = px, py, pz
        if prismatic[i]:
            continue
        s = math.sin(q[i])
        half = math.sin(0.5 * q[i])
        v = 2.0 * half * half
        a00, a01, a02 = 1.0 - v * (ay * ay + az * az), v * ax * ay - s * az, v * ax * az + s * ay
        a10, a11, a12 = v * ax * ay + s * az, 1.0 - v * (ax * ax + az * az), v * ay * az - s * ax
        a20, a21, a22 = v * ax * az - s * ay, v * ay * az + s * ax, 1.0 - v * (ax * ax + ay * ay)
        r00, r01, r02 = (
            r00 * a00 + r01 * a10 + r02 * a20,
            r00 * a01 + r01 * a11 + r02 * a21,
            r00 * a02 + r01 * a12 + r02 * a22,
        )
        r10, r11, r12 = (
            r10 * a00 + r11 * a10 + r12 * a20,
            r10 * a01 + r11 * a11 + r12 * a21,
            r10 * a02 + r11 * a12 + r12 * a22,
        )
        r20, r21, r22 = (
            r20 * a00 + r21 * a10 + r22 * a20,
            r20 * a01 + r21 * a11 + r22 * a21,
            r20 * a02 + r21 * a12 + r22 * a22,
        )


@inlined
def _self_bound(shapes, placed, first, second):
    """A distance that two bodies have at least, squared, and what is to be taken from its root."""
    x = placed[first, 6] - placed[second, 6]
    y = placed[first, 7] - placed[second, 7]
    z = placed[first, 8] - placed[second, 8]
    return x * x + y * y + z * z, shapes.sizes[first] + shapes.sizes[second]


@inlined
def _bound(shapes, placed, body, box):
    """The same of a body and an obstacle that is no half-space; how deep the middle is inside is taken, too."""
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
        shapes: The bodies, :class:`Shapes`.
        boxes: The obstacles, see :class:`Surroundings`. Shape (o, 16).
        checked: Whether a body may not touch an obstacle. Shape (o, k).
        placed: Result of :func:`place`. Shape (k, 9).
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
    """Sorts a pair in among those that are kept, the nearest first; what is too many falls off the end."""
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
    """The pairs that are nearer than some distance, the nearest first.

    Args:
        shapes: The bodies, :class:`Shapes`.
        boxes: The obstacles, see :class:`Surroundings`. Shape (o, 16).
        checked: Whether a body may not touch an obstacle. Shape (o, k).
        placed: Result of :func:`place`. Shape (k, 9).
        core: Worked with. Shape (6,).
        within: The distance in [m].
        near: Receives signed distances in [m], of shape (c,), where what is farther than the c nearest is left out;
            pairs as in :func:`smallest`, of shape (c, 2); and unit vectors to the first body with the nearest point of
            its core in [m], of shape (c, 6).

    Returns:
        How many there are, at most c.
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
        shapes: The bodies, :class:`Shapes`.
        joints: Axes and points of the joints, see :func:`place`. Shape (n, 6).
        first: A body.
        second: Another body, or k plus the number of an obstacle.
        vector: Unit vector to the first body, and the nearest point of its core in [m]. Shape (6,).
        out: Receives the gradient; joints that move both bodies or none have 0. Shape (n,).
    """
    links = shapes.links
    until, since = links[first], links[second] if second < links.shape[0] else 0
    for j in range(out.shape[0]):
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
