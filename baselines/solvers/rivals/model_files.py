"""An arm as a URDF or an MJCF file, for programs that read nothing else."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from baselines.solvers.rivals.solids import WORLD, Solids
from ikgym.arms import Arm
from ikgym.kernels.rotations import quaternion
from ikgym.validation import FloatArray

BASE, TIP = "base", "tool"
#: Written to a URDF for a limit that is none: readers take numbers beyond 1e20 as infinite.
NO_LIMIT = 1e21


def joint_name(i: int) -> str:
    """Name of joint i in an MJCF, counted from 0."""
    return f"joint{i + 1}"


def urdf(arm: Arm, solids: Solids | None = None) -> str:
    """The chain of an arm from link ``base`` to link ``tool``, with its names and limits of position and velocity.

    Args:
        arm: The arm.
        solids: Its bodies and the obstacles, each as a separate link.
    """
    n = arm.joints
    links = [f'<link name="{name}"/>' for name in (BASE, *(f"link{i}" for i in range(1, n + 1)), TIP)]
    lower, upper = np.maximum(arm.lower, -NO_LIMIT), np.minimum(arm.upper, NO_LIMIT)
    velocity = np.minimum(arm.velocity_limit, NO_LIMIT)
    joints = [
        f'<joint name={quoteattr(arm.joint_names[i])} type="{"prismatic" if arm.prismatic[i] else "revolute"}">'
        f'<parent link="{f"link{i}" if i else BASE}"/><child link="link{i + 1}"/>'
        f'<origin xyz="{_text(arm.offsets[i])}" rpy="0 0 0"/><axis xyz="{_text(arm.axes[i])}"/>'
        f'<limit lower="{float(lower[i])!r}" upper="{float(upper[i])!r}" '
        f'velocity="{float(velocity[i])!r}" effort="1"/></joint>'
        for i in range(n)
    ]
    tool = (
        f'<joint name="tool_joint" type="fixed"><parent link="link{n}"/><child link="{TIP}"/>'
        f'<origin xyz="{_text(arm.tool)}" rpy="{_text(roll_pitch_yaw(arm.tool_rotation))}"/></joint>'
    )
    parts = [*links, *joints, tool, *_collisions(solids or Solids())]
    return f"<robot name={quoteattr(arm.name)}>{''.join(parts)}</robot>"


def _collisions(solids: Solids) -> Iterator[str]:
    for i, (link, kind, rotation, position, half, radius) in enumerate(solids.each):
        name, parent = geom_name(i), f"link{link}" if link > 0 else BASE
        if kind == "plane":  # A box whose face is the plane: URDF has no half-spaces.
            position, half = position - _WIDE * rotation[:, 2], np.full(3, _WIDE)
        shape = {
            "sphere": f'<sphere radius="{radius!r}"/>',
            "capsule": f'<cylinder radius="{radius!r}" length="{2.0 * float(half[2])!r}"/>',
        }.get(kind, f'<box size="{_text(2.0 * half)}"/>')
        # Pinocchio takes such a cylinder for a capsule.
        capsule = f'<collision_checking><capsule name="{name}"/></collision_checking>' if kind == "capsule" else ""
        yield (
            f'<link name="{name}">{capsule}<collision name="{name}"><geometry>{shape}</geometry></collision></link>'
            f'<joint name="{name}_joint" type="fixed"><parent link="{parent}"/><child link="{name}"/>'
            f'<origin xyz="{_text(position)}" rpy="{_text(roll_pitch_yaw(rotation))}"/></joint>'
        )


def geom_name(i: int) -> str:
    """Name of solid i, of its link in a URDF and of its geom in an MJCF."""
    return f"solid{i}"


def mjcf(arm: Arm, solids: Solids | None = None) -> str:
    """The chain of an arm from body ``base`` to body ``tool``, with its limits of position: MJCF has no others.

    Args:
        arm: The arm.
        solids: Its bodies and the obstacles. MuJoCo counts a moving base as none of the world, so that link 1 can meet
            bodies fixed to the world.
    """
    solids = solids or Solids()
    body = f'<body name="{TIP}" pos="{_text(arm.tool)}" quat="{_text(quaternion(arm.tool_rotation))}">{_MASS}</body>'
    for i in reversed(range(arm.joints)):
        # A joint with one limit alone is limited, too, and the other one is out of reach.
        low, high = max(arm.lower[i], -_FAR), min(arm.upper[i], _FAR)
        limited = bool(np.isfinite([arm.lower[i], arm.upper[i]]).any())
        reach = f'limited="true" range="{_text((low, high))}"' if limited else 'limited="false"'
        body = (
            f'<body name="link{i + 1}" pos="{_text(arm.offsets[i])}">{_MASS}'
            f'<joint name="{joint_name(i)}" type="{"slide" if arm.prismatic[i] else "hinge"}" '
            f'axis="{_text(arm.axes[i])}" {reach}/>{_geoms(solids, i + 1)}{body}</body>'
        )
    mocap = ' mocap="true"' if solids.each else ""
    base = f'<body name="{BASE}"{mocap}>{_geoms(solids, 0)}{body}</body>'
    return (
        f'<mujoco model="{arm.name}"><compiler angle="radian"/>'
        f"<worldbody>{_geoms(solids, WORLD)}{base}</worldbody></mujoco>"
    )


def _geoms(solids: Solids, link: int) -> str:
    out = []
    for i, (of, kind, rotation, position, half, radius) in enumerate(solids.each):
        sizes: dict[str, Sequence[float] | FloatArray] = {
            "sphere": (radius,),
            "capsule": (radius, half[2]),
            "box": half,
            "plane": (0.0, 0.0, 1.0),
        }
        place = f'pos="{_text(position)}" quat="{_text(quaternion(rotation))}"'
        if of == link:
            out.append(f'<geom name="{geom_name(i)}" type="{kind}" size="{_text(sizes[kind])}" {place}/>')
    return "".join(out)


#: MuJoCo refuses bodies that move and have no mass; kinematics take no notice of it.
_MASS = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
#: Half of the edges in [m] of the box in place of a half-space: more than any arm reaches.
_WIDE = 10.0
#: Farther than a joint goes, and less than MuJoCo's largest number.
_FAR = 1e9


def roll_pitch_yaw(rotation: FloatArray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation in [rad], R = Rz(yaw) Ry(pitch) Rx(roll)."""
    pitch = math.atan2(-rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    if math.hypot(rotation[0, 0], rotation[1, 0]) < 1e-9:  # straight up or down: roll and yaw turn about one axis
        return math.copysign(1.0, -rotation[2, 0]) * math.atan2(rotation[0, 1], rotation[1, 1]), pitch, 0.0
    return math.atan2(rotation[2, 1], rotation[2, 2]), pitch, math.atan2(rotation[1, 0], rotation[0, 0])


def _text(numbers: FloatArray | Sequence[float]) -> str:
    return " ".join(repr(float(x)) for x in numbers)
