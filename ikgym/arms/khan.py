"""The 8-joint arm of Khan and Tar 2020: the approximate model (eq. 3.13, 3.14) and the exact arm (Table 1, eq. 3.15).

A solver knows the approximate arm; poses are measured on the exact one. Beside them the planar arm with 2 joints that
the paper's section 2 speaks of.
"""

from __future__ import annotations

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.rotations import rodrigues
from ikgym.validation import FloatArray

_R2, _R3 = 1 / np.sqrt(2), 1 / np.sqrt(3)
APPROXIMATE_AXES = np.array(
    [
        [0, 0, 1],
        [0, 1, 0],
        [0, 1, 0],
        [_R2, 0, -_R2],
        [_R2, 0, _R2],
        [0, 1, 0],
        [_R3, _R3, _R3],
        [_R3, -_R3, _R3],
    ]
)
# Table 1, angles about X1, X2, X3 in [rad]; the factor 2 is the table's own.
ROTATIONS = 2 * np.array(
    [
        [0.10, 0.09, 0.08],
        [0.02, 0.02, 0.00],
        [0.02, 0.03, 0.07],
        [0.08, 0.06, 0.04],
        [0.05, 0.01, 0.07],
        [0.03, 0.01, 0.06],
        [0.06, 0.06, 0.08],
        [0.04, 0.01, 0.10],
    ]
)


def khan8_approximate() -> Arm:
    """The solver's model: canonical axes, lengths 1, 1.5 and 2 m."""
    return Arm("khan8_approximate", _segments(1.0, 1.5, 2.0), _unit(APPROXIMATE_AXES), tool=np.array([2.5, 2.5, 2.5]))


def khan8() -> Arm:
    """The exact arm: axes turned by Table 1, lengths 1.2, 1.8 and 2.2 m."""
    x, y, z = np.eye(3)
    axes = [
        rodrigues(x, a) @ rodrigues(y, b) @ rodrigues(z, c) @ axis
        for (a, b, c), axis in zip(ROTATIONS, APPROXIMATE_AXES, strict=True)
    ]
    return Arm("khan8", _segments(1.2, 1.8, 2.2), _unit(np.array(axes)), tool=np.array([2.6, 2.4, 2.3]))


def planar2() -> Arm:
    """The simplest arm with 2 joints (section 2): axes z, z; links of 0.8 and 0.5 m, those of Faitli and Tar 2018."""
    return Arm(
        "planar2",
        offsets=np.array([[0, 0, 0], [0.8, 0, 0]]),
        axes=np.array([[0, 0, 1], [0, 0, 1]], dtype=float),
        tool=np.array([0.5, 0, 0]),
    )


def _segments(l1: float, l2: float, l3: float) -> FloatArray:
    """The shift parameters of eq. 3.14 and 3.15, one row a joint, in [m]."""
    return np.array(
        [
            [0, 0, l1],
            [l1, 0, 0],
            [l1, 0, 0],
            [l1, 0, l2],
            [l3, 0, l3],
            [l3, l3, 0],
            [l1, -l2, l3],
            [l3, l2, -l1],
        ]
    )


def _unit(axes: FloatArray) -> FloatArray:
    """Axes whose length differs from 1 by the rounding of their parts alone, divided by it."""
    scaled: FloatArray = axes / np.linalg.norm(axes, axis=1)[:, None]
    return scaled


ARMS = {"khan8": khan8, "khan8_approximate": khan8_approximate, "planar2": planar2}
