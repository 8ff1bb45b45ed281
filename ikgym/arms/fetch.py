"""Fetch Robotics' Fetch: its arm, with the torso that lifts it and with the torso down."""

from __future__ import annotations

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.directions import directions

TORSO = np.array([-0.086875, 0, 0.37743])
SHOULDER = np.array([0.119525, 0, 0.34858])
ARM = np.array(
    [[0.117, 0, 0.06], [0.219, 0, 0], [0.133, 0, 0], [0.197, 0, 0], [0.1245, 0, 0], [0.1385, 0, 0]],
)
GRIPPER = np.array([0.16645, 0, 0])
LOWER = np.array([0, -1.6056, -1.221, -np.inf, -2.251, -np.inf, -2.16, -np.inf])
UPPER = np.array([0.38615, 1.6056, 1.518, np.inf, 2.251, np.inf, 2.16, np.inf])
VELOCITY = np.array([0.1, 1.256, 1.454, 1.571, 1.521, 1.571, 2.268, 2.268])
ACCELERATION = np.array([0.5, 1.5, 1.0, 1.5, 1.5, 1.5, 2.5, 2.5])
HOME = np.array([0.2, 0, -0.5, 0, 1.5, 0, -1, 0])
NAMES = tuple(
    f"{part}_joint"
    for part in (
        *("torso_lift", "shoulder_pan", "shoulder_lift", "upperarm_roll"),
        *("elbow_flex", "forearm_roll", "wrist_flex", "wrist_roll"),
    )
)


def fetch() -> Arm:
    """Torso and arm from `base_link` to `gripper_link`, the point between the fingers; joint 1 is prismatic.

    Kinematic numbers and limits of fetch_description, whose licence (CC BY-NC-SA 4.0) forbids commercial use: none of
    its files is here. Accelerations of fetch_moveit_config, which plans with a third less velocity at the shoulder's
    lift. Three joints turn without end.
    """
    return Arm(
        "fetch",
        offsets=np.vstack([TORSO, SHOULDER, ARM]),
        axes=directions("z z y x y x y x"),
        prismatic=(True, *7 * (False,)),
        tool=GRIPPER,
        lower=LOWER,
        upper=UPPER,
        velocity_limit=VELOCITY,
        acceleration_limit=ACCELERATION,
        home=HOME,
        joint_names=NAMES,
    )


def fetch_arm() -> Arm:
    """The seven joints of :func:`fetch` with the torso down, from `base_link`, too."""
    return Arm(
        "fetch_arm",
        offsets=np.vstack([TORSO + SHOULDER, ARM]),
        axes=directions("z y x y x y x"),
        tool=GRIPPER,
        lower=LOWER[1:],
        upper=UPPER[1:],
        velocity_limit=VELOCITY[1:],
        acceleration_limit=ACCELERATION[1:],
        home=HOME[1:],
        joint_names=NAMES[1:],
    )


ARMS = {"fetch": fetch, "fetch_arm": fetch_arm}
