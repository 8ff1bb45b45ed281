"""The 3-joint arm of Faitli and Tar 2018 (eq. 2, Table 1)."""

from __future__ import annotations

import numpy as np

from ikgym.arms.arm import Arm


def faitli3() -> Arm:
    """Axes z, y, y; links of 1.5, 0.8 and 0.5 m; stretched out at q = 0."""
    return Arm(
        "faitli3",
        offsets=np.array([[0, 0, 1.5], [0, 0, 0], [0.8, 0, 0]]),
        axes=np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0]], dtype=float),
        tool=np.array([0.5, 0, 0]),
    )


ARMS = {"faitli3": faitli3}
