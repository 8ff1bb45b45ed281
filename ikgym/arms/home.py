"""Arms from the poses of their joints at q = 0; the last step of every conversion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.validation import FloatArray


def from_home(
    name: str,
    axes: FloatArray,
    points: FloatArray,
    prismatic: Sequence[bool],
    rotation: FloatArray,
    position: FloatArray,
    **fields: Any,
) -> Arm:
    """An arm from the home pose of its joints and of its tool, all in the base frame.

    Axes (n, 3) are of unit length; points (n, 3) are on the axes, in [m]. Since all link frames are parallel to the
    base at q = 0, the offsets are the differences of the points, and the fixed rotations between links combine to the
    tool's home orientation.
    """
    offsets = np.diff(points, axis=0, prepend=np.zeros((1, 3)))
    return Arm(name, offsets, axes, prismatic, tool=position - points[-1], tool_rotation=rotation, **fields)
