"""PAL Robotics' TIAGo: the arm and the torso that lifts it."""

from __future__ import annotations

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.directions import directions


def tiago() -> Arm:
    """TIAGo's torso and arm from `base_link` to `arm_tool_link`, where the wrist ends; joint 1 is prismatic.

    Kinematic numbers and limits of tiago_description, read from `example-robot-data`, whose licence (CC BY-NC-ND 3.0)
    forbids commercial use and changes: none of its files is here. tiago_moveit_config has the same velocities, and no
    accelerations.
    """
    turn = np.pi / 8
    return Arm(
        "tiago",
        offsets=np.array(
            [
                [-0.062, 0, 0.79],
                [0.15505, 0.014, -0.151],
                [0.0165, -0.125, -0.031],
                [-0.0015, -0.0895, 0],
                [-0.027, -0.222, -0.02],
                [0.027, -0.162, 0.02],
                [0, -0.15, 0],
                [0, 0, 0],
            ]
        ),
        axes=directions("z z -x y x -y z -y"),
        prismatic=(True, *7 * (False,)),
        tool=np.array([0, -0.046, 0]),
        tool_rotation=np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
        lower=np.array([0, 0, -4 * turn, -9 * turn, -turn, -2 * np.pi / 3, -3.6 * turn, -2 * np.pi / 3]),
        upper=np.array([0.35, 7 * turn, 1.0908307825, 4 * turn, 6 * turn, 2 * np.pi / 3, 3.6 * turn, 2 * np.pi / 3]),
        velocity_limit=np.array([0.07, 2.7, 3.66, 4.58, 4.58, 1.95, 1.76, 1.76]),
        home=np.array([0.1, 1, 0.5, -2, 1.5, -0.75, -0.5, -0.75]),
        joint_names=["torso_lift_joint", *(f"arm_{i}_joint" for i in range(1, 8))],
    )


ARMS = {"tiago": tiago}
