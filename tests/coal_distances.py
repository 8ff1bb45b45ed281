"""Distances between the bodies of an arm and from boxes, measured by coal."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from ikgym.arms import Arm
from ikgym.obstacles import Box, Capsule
from ikgym.validation import FloatArray
from tests.pinocchio_models import model_of


def ten_boxes() -> list[Box]:
    """Boxes of 5 to 30 cm around the arm, as drawn."""
    rng = np.random.default_rng(0)
    out = []
    for i in range(10):
        angle, far = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 0.9)
        position = np.array([far * np.cos(angle), far * np.sin(angle), rng.uniform(0.0, 0.9)])
        out.append(Box(f"box{i}", position, rng.uniform(0.05, 0.3, 3), Rotation.random(rng=rng).as_matrix()))
    return out


def postures(arm: Arm, count: int) -> FloatArray:
    """Drawn evenly between the limits. Shape (count, n)."""
    return np.random.default_rng(0).uniform(arm.lower, arm.upper, (count, arm.joints))


def with_coal(arm: Arm, obstacles: Sequence[Box]) -> tuple[Callable[[FloatArray], object], pin.GeometryData]:
    """The same pairs for coal: a call that measures all of their distances, and where it leaves them."""
    model, _ = model_of(arm)
    shapes, around, scene = arm.bodies.shapes, arm.bodies.surroundings(obstacles), pin.GeometryModel()
    for name, link, start, end, radius in zip(arm.bodies.names, *shapes[:4], strict=True):
        box = Capsule(name, start, end, radius).numbers()
        scene.addGeometryObject(_geometry(name, int(link), box, coal.Capsule(radius, 2.0 * box[14])))
    for one, box in zip(obstacles, around.boxes, strict=True):
        scene.addGeometryObject(_geometry(one.name, 0, box, coal.Box(*one.size)))
    for first, second in shapes.pairs.tolist():
        scene.addCollisionPair(pin.CollisionPair(first, second))
    for obstacle, body in np.argwhere(around.checked).tolist():
        scene.addCollisionPair(pin.CollisionPair(body, len(arm.bodies) + obstacle))
    data, found = model.createData(), scene.createData()
    return (lambda q: pin.computeDistances(model, data, scene, found, q)), found


def _geometry(name: str, joint: int, box: FloatArray, shape: coal.CollisionGeometry) -> pin.GeometryObject:
    return pin.GeometryObject(name, joint, pin.SE3(box[:9].reshape(3, 3), box[9:12]), shape)
