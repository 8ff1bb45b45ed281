"""Flexiv's Rizon 4."""

from __future__ import annotations

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.directions import directions


def rizon4() -> Arm:
    """The Rizon 4 from `base_link` to `flange`.

    Numbers of flexiv_description (Apache-2.0), as in `jrl`. Flexiv publishes no accelerations.
    """
    return Arm(
        "rizon4",
        offsets=np.array(
            [
                [0, 0, 0.155],
                [0, -0.03, 0.21],
                [0, -0.035, 0.205],
                [0.02, 0.03, 0.19],
                [-0.02, 0.025, 0.195],
                [0, -0.03, 0.19],
                [0.055, -0.07, 0.11],
            ]
        ),
        axes=directions("z -y z y z -y x"),
        tool=np.array([0.081, 0, 0]),
        tool_rotation=np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
        lower=np.array([-2.7925, -2.2689, -2.9671, -1.8675, -2.9671, -1.3963, -2.9671]),
        upper=np.array([2.7925, 2.2689, 2.9671, 2.6878, 2.9671, 4.5379, 2.9671]),
        velocity_limit=np.array([2.0944, 2.0944, 2.4435, 2.4435, 4.8869, 4.8869, 4.8869]),
        home=np.radians([0.0, -40.0, 0.0, 90.0, 0.0, 40.0, 0.0]),
        joint_names=[f"joint{i}" for i in range(1, 8)],
    )


ARMS = {"rizon4": rizon4}
