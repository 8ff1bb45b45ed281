"""Bodies and obstacles as solids: their surfaces, their outlines, and the closest pair.

All of them are boxes with rounded edges, rows of :class:`ikgym.kernels.bodies.Surroundings`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.arms import Arm
from ikgym.arms.bodies import Bodies
from ikgym.kernels.bodies import closest_rows
from ikgym.obstacles.obstacle import Obstacle, towards
from ikgym.trajectories.trajectory import frames_along
from ikgym.validation import IDENTITY, BoolArray, FloatArray

#: Stretches into which a quarter of a circle is divided.
STRETCHES = 5


class Closest(NamedTuple):
    """The bodies of an arm in N configurations, and the closest pair of them and of obstacles.

    Attributes:
        distances: Signed distances of the pairs in [m], infinite where nothing can meet. Shape (N,).
        pairs: A body, and another one, or k plus the number of an obstacle; -1 where nothing can meet. Shape (N, 2).
        points: The closest points of the two in [m], NaN where nothing can meet. Shape (N, 2, 3).
        bodies: The bodies as solids. Shape (N, k, 16).
    """

    distances: FloatArray
    pairs: npt.NDArray[np.int64]
    points: FloatArray
    bodies: FloatArray


def closest(arm: Arm, q: FloatArray, boxes: FloatArray, checked: BoolArray) -> Closest:
    """The bodies of an arm and their closest pair.

    Obstacles, of shape (N or 1, o, 16), are given for each configuration, of shape (N, n), or once for all; `checked`
    says whether a body may not touch an obstacle, in shape (o, k). Distances of an arm of which not all links were
    looked at are infinite.
    """
    rows, shapes = len(q), arm.bodies.shapes
    distances, pairs, points = np.empty(rows), np.empty((rows, 2), dtype=np.int64), np.empty((rows, 2, 3))
    placed = np.empty((rows, len(arm.bodies), 9))
    closest_rows(arm.chain, shapes, boxes, checked, np.ascontiguousarray(q), distances, pairs, points, placed)
    if arm.bodies.unseen:
        distances[:] = np.inf
    return Closest(distances, pairs, points, _capsules(placed, shapes.radii))


def solids_of(obstacles: Sequence[Obstacle], times: FloatArray, model: Arm) -> FloatArray:
    """Obstacles at some times in [s], of shape (k, o, 16), or (1, o, 16) where none moves.

    Motions that are joint paths are mapped through the kinematics of the model. Obstacles that are drawn are as before.
    """
    along = [one.along(times, model).reshape(-1, one.count, 16) for one in obstacles]
    rows = max(map(len, along), default=1)
    parts = [np.broadcast_to(numbers, (rows, *numbers.shape[1:])) for numbers in along]
    return np.concatenate([np.empty((rows, 0, 16)), *parts], axis=1)


def on_links(bodies: Bodies) -> FloatArray:
    """The bodies of an arm as solids in the frames of their links. Shape (k, 16)."""
    middles = 0.5 * (bodies.starts + bodies.ends)
    return _capsules(np.hstack([bodies.starts, bodies.ends, middles]), bodies.radii)


def link_frames(arm: Arm, q: FloatArray) -> FloatArray:
    """The frames of the links of an arm, that of the base first: rotations row by row, and positions in [m].

    Shapes (N, n) of joint coordinates, and (N, n + 1, 12).
    """
    frames = [np.tile([*IDENTITY.ravel(), 0.0, 0.0, 0.0], (len(q), 1))]
    for link in range(1, arm.joints + 1):
        before = Arm(arm.name, arm.offsets[:link], arm.axes[:link], arm.prismatic[:link])
        frames.append(frames_along(q[:, :link], before))
    return np.stack(frames, axis=1)


def surface(size: FloatArray, stretches: int = STRETCHES) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """The surface of a solid, in its frame, from half of its edges and its radius, the last four numbers of a row.

    Returns:
        Vertices in [m], of shape (v, 3), and the numbers of three of them for each triangle, of shape (t, 3).
    """
    angles, (east, north) = _circle(size[3], stretches)
    along = 2 * (len(angles) // 4)
    polar = angles[:along]  # from one pole to the other
    directions = [np.outer(np.sin(polar), np.cos(angles)), np.outer(np.sin(polar), np.sin(angles))]
    directions.append(np.tile(np.cos(polar)[:, None], len(angles)))
    signs = np.broadcast_arrays(east, north, np.repeat([1.0, -1.0], along // 2)[:, None])
    vertices = size[3] * np.stack(directions, axis=-1) + size[:3] * np.stack(signs, axis=-1)
    # Where an edge has no length, vertices on both sides of it are one.
    _, first, number = np.unique(vertices.reshape(-1, 3).round(9), axis=0, return_index=True, return_inverse=True)
    faces = number.ravel()[_grid(along, len(angles))]
    flat = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    return vertices.reshape(-1, 3)[first], faces[~flat]


def outline(size: FloatArray) -> FloatArray:
    """Closed lines on the surface of a solid, each followed by a row of NaN, in [m]; see :func:`surface`. (p, 3)."""
    angles, signs = _circle(size[3], STRETCHES)
    ring = np.stack([np.cos(angles), np.sin(angles)]), np.stack(signs)
    lines = []
    for axis in range(3):
        plane = [one for one in range(3) if one != axis]
        for side in (-1.0, 1.0)[int(size[axis] == 0.0) :]:  # the two are one where an edge has no length
            line = np.full((len(angles) + 2, 3), np.nan)
            line[:-1, axis] = side * size[axis]
            line[:-2, plane] = (size[3] * ring[0] + size[plane, None] * ring[1]).T
            line[-2] = line[0]
            lines.append(line)
    return np.vstack(lines)


def in_space(solid: FloatArray, points: FloatArray) -> FloatArray:
    """Points of a solid in the base frame: from the frame of the solid; both of shape (p, 3) in [m]."""
    moved: FloatArray = points @ solid[:9].reshape(3, 3).T + solid[9:12]
    return moved


def cut_half_spaces(solids: FloatArray, edge: float, centre: npt.ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """The same solids, of shape (..., 16), half-spaces as square plates.

    The middle of a plate is the point of the face that is closest to `centre`; `edge` is half of its edge, in [m].
    """
    out, normal = solids.copy(), solids[..., 2:9:3]
    above = (normal * (np.asarray(centre) - solids[..., 9:12])).sum(axis=-1, keepdims=True)
    plate = np.broadcast_to([edge, edge, 0.0, 0.0], out[..., 12:].shape)
    flat = np.concatenate([np.asarray(centre) - above * normal, plate], axis=-1)
    out[..., 9:] = np.where(solids[..., 12:13] < 0.0, flat, out[..., 9:])
    return out


def _capsules(placed: FloatArray, radii: FloatArray) -> FloatArray:
    """Bodies by start, end and middle, of shape (..., k, 9), as solids, of shape (..., k, 16)."""
    along = placed[..., 3:6] - placed[..., :3]
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    out = np.zeros((*placed.shape[:-1], 16))
    direction = np.where(length > 0.0, along, (0.0, 0.0, 1.0)) / np.where(length > 0.0, length, 1.0)
    out[..., :9] = towards(direction).reshape(*out.shape[:-1], 9)
    out[..., 9:12], out[..., 14], out[..., 15] = placed[..., 6:], 0.5 * length[..., 0], radii
    return out


def _circle(radius: float, stretches: int) -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
    """Angles around a circle, the ends of its quarters twice, with the signs of cosine and sine in each quarter.

    Without a radius, each quarter is a corner, and one angle will do.
    """
    quarter = np.linspace(0.0, 0.5 * np.pi, stretches + 1 if radius > 0.0 else 1)
    east, north = (np.repeat(pattern, len(quarter)) for pattern in ((1.0, -1.0, -1.0, 1.0), (1.0, 1.0, -1.0, -1.0)))
    return np.concatenate([0.5 * np.pi * k + quarter for k in range(4)]), (east, north)


def _grid(rows: int, columns: int) -> npt.NDArray[np.int64]:
    """Triangles of a grid of vertices that is closed around, and at both ends over its four corners."""
    numbers = np.arange(rows * columns).reshape(rows, columns)
    here, east = numbers, np.roll(numbers, -1, axis=1)
    corners = [(here[:-1], here[1:], east[1:]), (here[:-1], east[1:], east[:-1])]
    sides = [np.stack(three, axis=-1).reshape(-1, 3) for three in corners]
    top, bottom = numbers[0, :: columns // 4], numbers[-1, :: columns // 4]
    return np.vstack([*sides, top[[[0, 1, 2], [0, 2, 3]]], bottom[[[0, 2, 1], [0, 3, 2]]]])
