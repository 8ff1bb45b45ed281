"""The arms of Zhang 2020: the 3-joint arm of example 1 (eq. 42) and the stand-in for the robot of example 2."""

from __future__ import annotations

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.denavit_hartenberg import from_dh


def zhang3() -> Arm:
    """Axes z, y, y; links of 5, 7 and 7 m.

    The printed eq. 42 has a misplaced parenthesis; meant is x = (l₂ s₂ + l₃ s₂₃) c₁.
    """
    return Arm(
        "zhang3",
        offsets=np.array([[0, 0, 5], [0, 0, 0], [0, 0, 7]], dtype=float),
        axes=np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0]], dtype=float),
        tool=np.array([0, 0, 7], dtype=float),
    )


def puma560() -> Arm:
    """The Puma 560, standing in for the robot of example 2, whose parameters the paper does not print."""
    return from_dh(
        "puma560",
        a=[0, 0.4318, 0.0203, 0, 0, 0],
        d=[0.67183, 0, 0.15005, 0.4318, 0, 0],
        alpha=[np.pi / 2, 0, -np.pi / 2, np.pi / 2, -np.pi / 2, 0],
    )


ARMS = {"zhang3": zhang3, "puma560": puma560}
