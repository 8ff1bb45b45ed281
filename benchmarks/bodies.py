"""Distances between the bodies of a Panda with a hand, and from ten boxes, beside coal: how long they take."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import ikgym
from benchmarks.measuring import FULL, Effort, per_item
from benchmarks.poses import pinocchio_model
from benchmarks.table import Table
from ikgym.arms import Arm
from ikgym.kernels.bodies import clearance_rows, near_rows
from ikgym.obstacles import Box, Capsule
from ikgym.validation import FloatArray

ARM = "panda-hand"
#: Postures of a batch.
LOOP = 1000
#: Pairs that are nearer are asked for, in [m], and at most so many.
NEAR, MOST = 0.1, 16


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


def kernels(arm: Arm, obstacles: Sequence[Box]) -> dict[str, tuple[Callable[[], object], int]]:
    """Calls by name, with the number of postures of each."""
    q, shapes, around = postures(arm, LOOP), arm.bodies.shapes, arm.bodies.surroundings(obstacles)
    distances, pairs = np.empty(LOOP), np.empty((LOOP, 2), dtype=np.int64)
    counts, near = np.empty(LOOP, dtype=np.int64), np.empty((LOOP, MOST))
    near_pairs, gradients = np.empty((LOOP, MOST, 2), dtype=np.int64), np.empty((LOOP, MOST, arm.joints))
    near_to = (NEAR, counts, near, near_pairs, gradients)
    given = arm.chain, shapes, *around, q
    return {
        "ikgym, the smallest": (lambda: clearance_rows(*given, distances, pairs), LOOP),
        f"ikgym, all within {NEAR:g} m, with gradients": (lambda: near_rows(*given, *near_to), LOOP),
        "ikgym Arm.clearance, one call": (lambda: arm.clearance(q[0], obstacles), 1),
    }


def with_coal(arm: Arm, obstacles: Sequence[Box]) -> tuple[Callable[[FloatArray], object], pin.GeometryData]:
    """The same pairs for coal: a call that measures all of their distances, and where it leaves them."""
    model, _ = pinocchio_model(arm)
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


def tables(effort: Effort = FULL) -> list[Table]:
    """Distances of the bodies of a Panda with a hand from each other and from ten boxes."""
    arm, obstacles = ikgym.arms.get(ARM), ten_boxes()
    calls, (measure, _), q = kernels(arm, obstacles), with_coal(arm, obstacles), postures(arm, LOOP)

    def loop() -> None:
        for row in q:
            measure(row)

    calls["coal by pin.computeDistances, all distances"] = (loop, LOOP)
    around = arm.bodies.surroundings(obstacles)
    return [
        Table(
            "Distances of bodies: Panda with hand, ten boxes",
            f"{len(arm.bodies)} capsules, {len(arm.bodies.pairs)} pairs of them and {around.checked.sum()} with boxes, "
            f"at {LOOP} random postures, forward kinematics included, one thread, medians. coal measures pair by pair "
            "in one call a posture, without a broad phase.",
            ("per posture [µs]", "× the smallest"),
            per_item(calls, effort),
        )
    ]
