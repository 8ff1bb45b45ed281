"""Ranges, settings and workspace of the inverse kinematics, as kernels take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt


class Ranges(NamedTuple):
    """Ranges of joint coordinates and of restarts, in [rad] or [m].

    Attributes:
        lower: Lower limits, -inf where there is none. Shape (n,).
        upper: Upper limits, inf where there is none. Shape (n,).
        first: Lower ends of the restarts, finite. Shape (n,).
        last: Upper ends of the restarts, finite. Shape (n,).
    """

    lower: npt.NDArray[np.float64]
    upper: npt.NDArray[np.float64]
    first: npt.NDArray[np.float64]
    last: npt.NDArray[np.float64]


class Settings(NamedTuple):
    """Settings of a solve.

    Attributes:
        tolerance: Largest distance from the pose in [m], and largest angle in [rad].
        length: Weight of an angle of 1 rad, in [m].
        restarts: Random starts after the first one.
        key: Key of the random starts.
    """

    tolerance: float
    length: float
    restarts: int
    key: np.uint64


class Work(NamedTuple):
    """Workspace of a solve: a posture, its pose, and a step from it; m is 3 without orientation, and 6 with it.

    Attributes:
        q: Shape (n,).
        step: Shape (n,).
        rotation: Shape (3, 3).
        position: Shape (3,).
        jacobian: Its angular rows in units of length; 0 in columns of joints that a step takes to a limit. (6, n).
        error: Shape (m,).
        gram: Shape (m, m).
        weights: The step is Jᵀ times these. Shape (m,).
    """

    q: npt.NDArray[np.float64]
    step: npt.NDArray[np.float64]
    rotation: npt.NDArray[np.float64]
    position: npt.NDArray[np.float64]
    jacobian: npt.NDArray[np.float64]
    error: npt.NDArray[np.float64]
    gram: npt.NDArray[np.float64]
    weights: npt.NDArray[np.float64]
