"""An arm as a URDF file, for programs that read nothing else."""

from __future__ import annotations

import math

from ikgym.arms import Arm
from ikgym.validation import FloatArray

BASE, TIP = "base", "tool"


def arm_urdf(arm: Arm) -> str:
    """The chain of an arm from link ``base`` to link ``tool``, with its limits and nothing else.

    Args:
        arm: One whose joints have position and velocity limits, since a URDF file needs both.
    """
    n = arm.joints
    links = [f'<link name="{name}"/>' for name in (BASE, *(f"link{i}" for i in range(1, n + 1)), TIP)]
    joints = [
        f'<joint name="joint{i + 1}" type="{"prismatic" if arm.prismatic[i] else "revolute"}">'
        f'<parent link="{f"link{i}" if i else BASE}"/><child link="link{i + 1}"/>'
        f'<origin xyz="{_text(arm.offsets[i])}" rpy="0 0 0"/><axis xyz="{_text(arm.axes[i])}"/>'
        f'<limit lower="{float(arm.lower[i])!r}" upper="{float(arm.upper[i])!r}" '
        f'velocity="{float(arm.velocity_limit[i])!r}" effort="1"/></joint>'
        for i in range(n)
    ]
    tool = (
        f'<joint name="tool_joint" type="fixed"><parent link="link{n}"/><child link="{TIP}"/>'
        f'<origin xyz="{_text(arm.tool)}" rpy="{_text(roll_pitch_yaw(arm.tool_rotation))}"/></joint>'
    )
    return f'<robot name="{arm.name}">{"".join([*links, *joints, tool])}</robot>'


def roll_pitch_yaw(rotation: FloatArray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation in [rad], R = Rz(yaw) Ry(pitch) Rx(roll)."""
    pitch = math.atan2(-rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    if math.hypot(rotation[0, 0], rotation[1, 0]) < 1e-9:  # straight up or down: roll and yaw turn about one axis
        return math.copysign(1.0, -rotation[2, 0]) * math.atan2(rotation[0, 1], rotation[1, 1]), pitch, 0.0
    return math.atan2(rotation[2, 1], rotation[2, 2]), pitch, math.atan2(rotation[1, 0], rotation[0, 0])


def _text(numbers: FloatArray | tuple[float, ...]) -> str:
    return " ".join(repr(float(x)) for x in numbers)
