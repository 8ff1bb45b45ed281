"""Kernel: where the bodies of an arm are."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.jit import uncounted

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
