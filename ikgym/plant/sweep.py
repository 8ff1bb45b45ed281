"""How far bodies and obstacles move at most."""

from __future__ import annotations

import numpy as np

from ikgym.arms import Arm
from ikgym.validation import FloatArray


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
