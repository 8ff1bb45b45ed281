"""Arms from what is seen of them at q = 0; the last step of every conversion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ikgym.arms.arm import Arm
from ikgym.validation import FloatArray


def from_home(
    name: str,
    axes: FloatArray,
    points: FloatArray,
    prismatic: Sequence[bool],
    rotation: FloatArray,
    position: FloatArray,
    *,
    lower: npt.ArrayLike | None = None,
    upper: npt.ArrayLike | None = None,
    velocity_limit: npt.ArrayLike | None = None,
    acceleration_limit: npt.ArrayLike | None = None,
    joint_names: Sequence[str] = (),
) -> Arm:
    """An arm from the home pose of its joints and of its tool, all in the base frame.

    Since all link frames are parallel to the base at q = 0, the offsets are the differences of the joints'
    points, and the tool's home orientation is all that is left of the fixed rotations between links.

    Args:
        name: What the arm is called.
        axes: The joints' unit axes at q = 0. Shape (n, 3).
        points: A point on each axis at q = 0 in [m]. Shape (n, 3).
        prismatic: True where a joint is prismatic, one entry a joint.
        rotation: Orientation of the tool at q = 0. Shape (3, 3).
        position: Tool point at q = 0 in [m]. Shape (3,).
        lower: Lower limits of the joints in [rad] or [m]. Shape (n,).
        upper: Upper limits of the joints in [rad] or [m]. Shape (n,).
        velocity_limit: Largest speeds of the joints in [rad/s] or [m/s]. Shape (n,).
        acceleration_limit: Largest accelerations of the joints in [rad/s²] or [m/s²]. Shape (n,).
        joint_names: What the joints are called, n different texts.

    Returns:
        The arm.

    Raises:
        InvalidInputError: A shape, an axis, the orientation or a limit is wrong.
    """
    return Arm(
        name,
        offsets=np.diff(points, axis=0, prepend=np.zeros((1, 3))),
        axes=axes,
        prismatic=prismatic,
        tool=position - points[-1],
        tool_rotation=rotation,
        lower=lower,  # type: ignore[arg-type]
        upper=upper,  # type: ignore[arg-type]
        velocity_limit=velocity_limit,  # type: ignore[arg-type]
        acceleration_limit=acceleration_limit,  # type: ignore[arg-type]
        joint_names=joint_names,
    )
