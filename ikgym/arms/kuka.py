"""KUKA's LBR iiwa 14 R820."""

from __future__ import annotations

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.directions import directions


def iiwa14() -> Arm:
    """The LBR iiwa 14 R820 from its base to the flange of the robot, 0.126 m beyond the wrist.

    Lengths and limits: KUKA's data sheet of the LBR iiwa. The description of kuka_experimental (BSD-3-Clause, in
    `rtb-data`) puts joints 2 and 3 off the axis by 0.436 mm and rounds the limits down by 0.3 mrad; that of iiwa_stack
    (BSD-2-Clause, in `jrl`) has the lengths of the data sheet. KUKA publishes no accelerations.
    """
    upper = np.radians([170.0, 120.0, 170.0, 120.0, 170.0, 120.0, 175.0])
    return Arm(
        "iiwa14",
        offsets=np.array([[0, 0, 0.36], [0, 0, 0], [0, 0, 0.42], [0, 0, 0], [0, 0, 0.4], [0, 0, 0], [0, 0, 0]]),
        axes=directions("z y z -y z y z"),
        tool=np.array([0, 0, 0.126]),
        lower=-upper,
        upper=upper,
        velocity_limit=np.radians([85.0, 85.0, 100.0, 75.0, 130.0, 135.0, 135.0]),
        home=np.radians([0.0, 30.0, 0.0, -90.0, 0.0, 60.0, 0.0]),
        joint_names=[f"joint_a{i}" for i in range(1, 8)],
    )


ARMS = {"iiwa14": iiwa14}
