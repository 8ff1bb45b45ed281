"""Bodies and obstacles of a problem, as spheres, capsules, boxes and planes of other programs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from baselines.policy import Problem
from ikgym.obstacles.solids import on_links
from ikgym.validation import FloatArray

#: The link of obstacles.
WORLD = -1


class Solid(NamedTuple):
    """A body of the arm, or an obstacle at rest.

    Attributes:
        link: Number of its link; -1 for an obstacle.
        kind: `sphere`, `capsule` and `box`, or `plane` for a half-space.
        rotation: In the frame of its link; a capsule lies along its third axis, which leads out of a half-space. Shape
            (3, 3).
        position: In the frame of its link, in [m]. Shape (3,).
        half: Half of its edges in [m]. Shape (3,).
        radius: In [m].
    """

    link: int
    kind: str
    rotation: FloatArray
    position: FloatArray
    half: FloatArray
    radius: float


class Solids(NamedTuple):
    """All solids of a problem.

    Attributes:
        each: The bodies of the arm, then the obstacles.
        pairs: Numbers of two that must not touch.
    """

    each: Sequence[Solid] = ()
    pairs: Sequence[tuple[int, int]] = ()


def solids_of(problem: Problem) -> Solids:
    """The solids of a problem; none where touching does not matter."""
    around, bodies = problem.surroundings, problem.model.bodies
    if around is None:
        return Solids()
    links = [*bodies.links, *[WORLD] * len(around.boxes)]
    rows = np.vstack([on_links(bodies), around.boxes])
    met = [(body, len(bodies) + obstacle) for obstacle, body in np.argwhere(around.checked).tolist()]
    each = [_solid(link, row) for link, row in zip(links, rows, strict=True)]
    return Solids(each, [*map(tuple, bodies.pairs.tolist()), *met])


def geometry_model(solids: Solids, pinocchio: Any, coal: Any) -> Any:
    """The solids as a geometry model of Pinocchio, joint i of which moves link i."""
    out = pinocchio.GeometryModel()
    for i, (link, kind, rotation, position, half, radius) in enumerate(solids.each):
        make, sizes = {
            "sphere": (coal.Sphere, (radius,)),
            "capsule": (coal.Capsule, (radius, 2.0 * half[2])),
            "box": (coal.Box, tuple(2.0 * half)),
            "plane": (coal.Halfspace, (np.array([0.0, 0.0, 1.0]), 0.0)),
        }[kind]
        placement = pinocchio.SE3(rotation, position)
        out.addGeometryObject(pinocchio.GeometryObject(f"solid{i}", max(link, 0), placement, make(*sizes)))
    for pair in solids.pairs:
        out.addCollisionPair(pinocchio.CollisionPair(*pair))
    return out


def _solid(link: int, row: FloatArray) -> Solid:
    half, radius = row[12:15], float(row[15])
    kind = "plane" if half[0] < 0.0 else "box" if radius == 0.0 else "capsule" if half[2] > 0.0 else "sphere"
    return Solid(link, kind, row[:9].reshape(3, 3), row[9:12], half, radius)
