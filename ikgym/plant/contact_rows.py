"""The bodies and obstacles of N arms that are simulated side by side."""

from __future__ import annotations

import math

import numpy as np

from ikgym.arms import Arm
from ikgym.kernels.bodies import OBSTACLE, PLACED, Surroundings
from ikgym.kernels.bodies.proximity import ProximityParameters
from ikgym.kernels.random_numbers import CUT
from ikgym.plant.contact import Contacts
from ikgym.plant.plant import Plant
from ikgym.validation import FloatArray


def contact_rows(
    arm: Arm,
    plant: Plant,
    around: Surroundings,
    boxes: FloatArray,
    travel: FloatArray,
    rows: int,
    shown: bool,
    proximity: ProximityParameters,
) -> Contacts:
    """Bodies and obstacles of N arms.

    Args:
        arm: The arm of the data sheet.
        plant: The plant of the scenario.
        around: The obstacles.
        boxes: The obstacles after 0, 1, … steps, of all rows or one table a row. Shape (1 or N, steps + 2 or 1, o, 16).
        travel: Largest absolute joint coordinates in [rad] or [m]. Shape (n,).
        rows: N.
        shown: Whether observations show the obstacles.
        proximity: The shape of its cost.
    """
    shapes, n = arm.bodies.shapes, arm.joints
    bodies, obstacles = len(shapes.links), boxes.shape[2]
    return Contacts(
        links=shapes.links,
        radii=shapes.radii,
        sizes=shapes.sizes,
        pairs=shapes.pairs,
        sweep=sweep(arm, travel, CUT * math.sqrt(3.0) * float(np.max(plant.calibration)) * plant.link),
        checked=around.checked,
        boxes=boxes,
        drift=drift(boxes[0], arm.reach(travel)),
        shown=obstacles if shown else 0,
        proximity=proximity,
        starts=np.tile(shapes.starts, (rows, 2, 1, 1)),
        ends=np.tile(shapes.ends, (rows, 2, 1, 1)),
        distance=np.full(rows, np.inf),
        pair=np.full((rows, 2), -1),
        stopped=np.zeros(rows, dtype=np.bool_),
        before=np.zeros((rows, n)),
        between=np.zeros((rows, n)),
        joints=np.zeros((rows, n, 6)),
        placed=np.zeros((rows, bodies, PLACED)),
        moving=np.zeros((rows, obstacles, OBSTACLE)),
        core=np.zeros((rows, 6)),
    )


def sweep(arm: Arm, travel: FloatArray, longer: float) -> FloatArray:
    """How far each joint moves the core of each body at most, in [m] per unit of its coordinate. Shape (k, n).

    Args:
        arm: The arm.
        travel: Largest absolute joint coordinates; only those of prismatic joints count. Shape (n,).
        longer: Length that is added to each offset, in [m].
    """
    bodies = arm.bodies
    ends = np.maximum(np.linalg.norm(bodies.starts, axis=1), np.linalg.norm(bodies.ends, axis=1))
    lengths = np.linalg.norm(arm.offsets, axis=1) + np.where(arm.prismatic, travel, 0.0) + longer
    out = np.zeros((len(bodies), arm.joints))
    for body, link in enumerate(bodies.links):
        for joint in range(link):
            own = travel[joint] if arm.prismatic[joint] else 0.0
            out[body, joint] = 1.0 if arm.prismatic[joint] else own + lengths[joint + 1 : link].sum() + ends[body]
    return out


def drift(boxes: FloatArray, reach: float) -> FloatArray:
    """How far an obstacle moves at most from one step to the next, where an arm can be, in [m].

    Args:
        boxes: The obstacles after 0, 1, … steps. Shape (k, o, 16).
        reach: A radius around the base that the arm does not leave, in [m].

    Returns:
        Shape (k,), the last one 0.
    """
    out = np.zeros(len(boxes))
    if len(boxes) > 1 and boxes.shape[1]:
        change = np.abs(np.diff(boxes, axis=0))
        turned = np.linalg.norm(change[..., :9].reshape(*change.shape[:2], 3, 3), axis=2)
        # A half-space is turned about its position, far from which the arm may be.
        far = reach + np.linalg.norm(boxes[:-1, :, 9:12], axis=2, keepdims=True)
        half = np.where(boxes[:-1, :, 12:15] < 0.0, far, boxes[:-1, :, 12:15])
        moved = np.linalg.norm(change[..., 9:12], axis=2) + (turned * half).sum(axis=2)
        out[:-1] = moved.max(axis=1)
    return out
