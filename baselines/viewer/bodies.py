"""An arm as simple solids, each fixed to the frame of a joint, and where these frames are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ikgym.arms import Arm
from ikgym.validation import FloatArray

#: The frame that a solid of the base is fixed to.
BASE = -1

# Radii and lengths of solids, as shares of the arm's reach.
LINK, JOINT, JOINT_HALF, TOOL, RAIL = 0.016, 0.026, 0.034, 0.026, 0.009
# Links that are shorter than this share of the reach are within their joints.
SHORTEST = 1e-6


class Body(NamedTuple):
    """A solid around a straight line.

    Attributes:
        kind: ``"link"``, ``"revolute"``, ``"prismatic"``, ``"rail"`` or ``"tool"``.
        frame: The joint whose frame it is fixed to, counted from 0; :data:`BASE` for the base.
        joint: The joint that it shows, None for links and the tool.
        start: Where its axis begins, in this frame, in [m]. Shape (3,).
        end: Where its axis ends. Shape (3,).
        radius: In [m].
    """

    kind: str
    frame: int
    joint: int | None
    start: FloatArray
    end: FloatArray
    radius: float


def size(arm: Arm) -> float:
    """The length in [m] that solids are scaled by: the arm's reach, 1 where it has none."""
    return arm.reach(np.zeros(arm.joints)) or 1.0


def bodies(arm: Arm) -> list[Body]:
    """The solids of an arm: links, joints, rails of prismatic joints, and the tool."""
    return [*_links(arm), *(body for joint in range(arm.joints) for body in _joint(arm, joint)), _tool(arm)]


def joint_frames(arm: Arm, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where the frame of each joint is, seen from that of the joint before: ``H_i`` of :class:`ikgym.arms.Arm`.

    Args:
        arm: The arm.
        q: Joint coordinates in [rad] or [m]. Shape (n,).

    Returns:
        Positions in [m], of shape (n, 3), and unit quaternions (w, x, y, z), of shape (n, 4).
    """
    slides = np.array(arm.prismatic)
    travel, half = np.where(slides, q, 0.0), np.where(slides, 0.0, 0.5 * q)
    positions = arm.offsets + travel[:, None] * arm.axes
    return positions, np.hstack([np.cos(half)[:, None], np.sin(half)[:, None] * arm.axes])


def _links(arm: Arm) -> list[Body]:
    """From each joint to the next, and from the last one to the tool point."""
    ends = [*arm.offsets, arm.tool]
    whole = size(arm)
    return [
        Body("link", frame, None, np.zeros(3), end, LINK * whole)
        for frame, end in enumerate(ends, start=BASE)
        if np.linalg.norm(end) > SHORTEST * whole
    ]


def _joint(arm: Arm, joint: int) -> list[Body]:
    """A cylinder about the axis; of a prismatic joint a carriage, and the rail within its limits."""
    whole, axis = size(arm), arm.axes[joint]
    half = JOINT_HALF * whole * axis
    if not arm.prismatic[joint]:
        return [Body("revolute", joint, joint, -half, half, JOINT * whole)]
    first, last = np.clip((arm.lower[joint], arm.upper[joint]), -0.5 * whole, 0.5 * whole)
    begin, end = arm.offsets[joint] + first * axis, arm.offsets[joint] + last * axis
    return [
        Body("prismatic", joint, joint, -half, half, JOINT * whole),
        Body("rail", joint - 1, None, begin, end, RAIL * whole),
    ]


def _tool(arm: Arm) -> Body:
    """A ball at the tool point."""
    return Body("tool", arm.joints - 1, None, arm.tool, arm.tool, TOOL * size(arm))
