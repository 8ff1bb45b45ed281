"""Franka Emika's Panda, and its successor, the Franka Research 3."""

from __future__ import annotations

from typing import Any

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.directions import directions

# The same in both arms; modified Denavit–Hartenberg table of the Franka Control Interface (FCI) documentation.
OFFSETS = np.array(
    [[0, 0, 0.333], [0, 0, 0], [0, 0, 0.316], [0.0825, 0, 0], [-0.0825, 0, 0.384], [0, 0, 0], [0.088, 0, 0]]
)
AXES = directions("z y z -y z -y -z")
FLANGE = np.array([0, 0, -0.107])
FLANGE_ROTATION = np.diag([1.0, -1.0, -1.0])
#: The posture that both arms are delivered and started in.
READY = np.pi * np.array([0, -1 / 4, 0, -3 / 4, 0, 1 / 2, 1 / 4])
#: What the calibrated Pandas share with the nominal one.
PANDA: dict[str, Any] = {
    "joint_names": [f"panda_joint{i}" for i in range(1, 8)],
    "lower": np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]),
    "upper": np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]),
    "velocity_limit": np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61]),
    "acceleration_limit": np.array([15, 7.5, 10, 12.5, 15, 20, 20]),
}


def panda() -> Arm:
    """The Panda from `panda_link0` to its flange, `panda_link8`; the hand's tool point is 0.1034 m beyond along z.

    Kinematics, positions and velocities: franka_description (Apache-2.0), the same in `example-robot-data` and
    `robosuite`. Accelerations: libfranka 0.9 (Apache-2.0) and the FCI documentation. MoveIt's quarters of these
    accelerations are a planner's caution, and were not taken.
    """
    return Arm("panda", OFFSETS, AXES, tool=FLANGE, tool_rotation=FLANGE_ROTATION, home=READY, **PANDA)


def fr3() -> Arm:
    """The Franka Research 3 from `fr3_link0` to its flange, `fr3_link8`.

    Positions and velocities: franka_description (Apache-2.0), as in `jrl`. Accelerations: libfranka (Apache-2.0). Close
    to the ends of its joints the real arm is slower; franka_ros has narrower limits for that reason, which were not
    taken.
    """
    return Arm(
        "fr3",
        OFFSETS,
        AXES,
        tool=FLANGE,
        tool_rotation=FLANGE_ROTATION,
        lower=np.array([-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159]),
        upper=np.array([2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159]),
        velocity_limit=np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]),
        acceleration_limit=np.full(7, 10.0),
        home=READY,
        joint_names=[f"fr3_joint{i}" for i in range(1, 8)],
    )


ARMS = {"panda": panda, "fr3": fr3}
