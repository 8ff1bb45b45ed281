"""UFACTORY's xArm 7."""

from __future__ import annotations

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.directions import directions


def xarm7() -> Arm:
    """The xArm 7 from `link_base` to `link_eef`, its flange.

    Numbers of xarm_description (BSD-3-Clause, in `example-robot-data`), whose right angles are rounded to 1.5708 and
    exact here: they differ by up to 2e-5 in [m] and [rad]. UFACTORY's MoveIt configuration plans with 2.14 rad/s, and
    has no accelerations.
    """
    turn = 2.0 * np.pi
    return Arm(
        "xarm7",
        offsets=np.array(
            [
                [0, 0, 0.267],
                [0, 0, 0],
                [0, 0, 0.293],
                [0.0525, 0, 0],
                [0.0775, 0, -0.3425],
                [0, 0, 0],
                [0.076, 0, -0.097],
            ]
        ),
        axes=directions("z y z -y -z y -z"),
        tool_rotation=np.diag([1.0, -1.0, -1.0]),
        lower=np.array([-turn, -2.059, -turn, -0.19198, -turn, -1.69297, -turn]),
        upper=np.array([turn, 2.0944, turn, 3.927, turn, np.pi, turn]),
        velocity_limit=np.full(7, 3.14),
        home=np.array([0, -0.25, 0, 1.25, 0, 1.5, 0]),
        joint_names=[f"joint{i}" for i in range(1, 8)],
    )


ARMS = {"xarm7": xarm7}
