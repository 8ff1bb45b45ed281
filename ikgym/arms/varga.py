"""The 7-joint arm of Varga, Issa, Horváth and Tar 2021 (eq. 9 and 10), in both readings of eq. 6.

The paper gives the axes as the columns of E, the segments as the columns of R, and the tool point. Read
literally, eq. 6 puts a segment before its joint; then axes 4 and 5 are coaxial, the pose depends on q4 + q5
alone, and the arm is not redundant in any useful sense. If each segment follows its joint the axes are parallel
and the arm is redundant, as the paper's title says.
"""

from __future__ import annotations

import numpy as np

from ikgym.arms.arm import Arm

AXES = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
SEGMENTS = np.array([[0, 0, 1], [0, 0, 0], [2, 0, 0], [1, 0, 1], [1.5, 0, 0], [0, 0, 0], [0, 0, 0]])
TOOL = np.array([1.0, 0.0, 0.0])
PRISMATIC = (False, False, True, False, False, False, False)


def varga7() -> Arm:
    """Each segment follows its joint: the redundant reading, and the default."""
    offsets = np.vstack([np.zeros(3), SEGMENTS[:-1]])
    return Arm("varga7", offsets, AXES, PRISMATIC, tool=SEGMENTS[-1] + TOOL)


def varga7_literal() -> Arm:
    """Each segment stands before its joint, as eq. 6 is printed."""
    return Arm("varga7_literal", SEGMENTS, AXES, PRISMATIC, tool=TOOL)


ARMS = {"varga7": varga7, "varga7_literal": varga7_literal}
