"""A smooth joint motion from rest to rest."""

from __future__ import annotations

import dataclasses

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import LARGEST, SMALLEST, FloatArray, frozen_array, number

# Relative slack of bounds, for rounding.
SLACK = 1e-12


@dataclasses.dataclass(frozen=True, eq=False)
class JointSpline(Trajectory):
    """A uniform cubic B-spline in joint space, at rest before its beginning and from its end on.

    It never leaves the range of its control points; with c of them, h = T / (c - 3) apart, velocities do not exceed
    their largest difference over h, and accelerations their largest second difference over h² (de Boor, *A practical
    guide to splines*, chapter X: derivatives of a B-spline are B-splines of the differences).

    Args:
        control: Control points in [rad] or [m]; the first three are the same, and the last three. Shape (c, n), c >= 6.
        duration: T in [s].

    Raises:
        InvalidInputError: A shape is wrong, a number not finite or beyond 1e12, or an end not at rest.
    """

    control: FloatArray
    duration: float

    def __post_init__(self) -> None:
        control = frozen_array("control", self.control, (None, None), at_most=LARGEST)
        if len(control) < 6:
            raise InvalidInputError(f"control: expected at least 6 control points, got {len(control)}.")
        ends = control[[1, 2, -2, -3]] - control[[0, 0, -1, -1]]
        if ends.any():
            raise InvalidInputError("control: expected the first three to be the same and the last three, for rest.")
        self._settle(control=control)
        self._settle(duration=number("duration", self.duration, at_least=SMALLEST, at_most=LARGEST))

    def joint_path(self, times: FloatArray) -> FloatArray:
        """See :meth:`Trajectory.joint_path`."""
        path: FloatArray = splines_at(self.control[None], times[None], self.duration)[0]
        return path

    def joint_bound(self) -> FloatArray:
        """See :meth:`Trajectory.joint_bound`."""
        bound: FloatArray = np.abs(self.control).max(axis=0) * (1.0 + SLACK)
        return bound


def splines_at(control: FloatArray, times: FloatArray, duration: FloatArray | float) -> FloatArray:
    """Uniform cubic B-splines, constant beyond their ends.

    Args:
        control: Shape (k, c, n).
        times: In [s]. Shape (k, t).
        duration: In [s]. A number, or shape (k, 1).

    Returns:
        Joint coordinates. Shape (k, t, n).
    """
    spans = control.shape[1] - 3
    at = np.clip(times / duration, 0.0, 1.0) * spans
    i = np.minimum(at.astype(np.int64), spans - 1)
    u = (at - i)[..., None]
    rest, row = 1.0 - u, np.arange(len(control))[:, None]
    c0, c1, c2, c3 = (control[row, i + k] for k in range(4))
    inner = (4.0 + u * u * (3.0 * u - 6.0)) * c1 + (4.0 + rest * rest * (3.0 * rest - 6.0)) * c2
    out: FloatArray = (rest * rest * rest * c0 + inner + u * u * u * c3) / 6.0
    return out
