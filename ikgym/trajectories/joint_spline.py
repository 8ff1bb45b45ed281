"""A smooth joint motion from rest to rest."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.kernels.splines import spline_rows
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
        path: FloatArray = _splines_at(self.control[None], times[None], self.duration)[0]
        return path

    def joint_bound(self) -> FloatArray:
        """See :meth:`Trajectory.joint_bound`."""
        bound: FloatArray = np.abs(self.control).max(axis=0) * (1.0 + SLACK)
        return bound


class JointSplines(Sequence[JointSpline]):
    """The motions of several episodes, which begin by the thousands: each is an object only where one is asked for.

    Args:
        control: Control points in [rad] or [m], as those of :class:`JointSpline`. Shape (k, c, n).
        duration: T in [s].
    """

    def __init__(self, control: FloatArray, duration: float) -> None:
        self.control, self.duration = control, duration

    def __len__(self) -> int:
        return len(self.control)

    def __getitem__(self, row: Any) -> Any:
        return JointSpline(self.control[row], self.duration)

    def joint_paths(self, times: FloatArray) -> FloatArray:
        """The joint path of each motion at times of its own, of shape (k, t): see :meth:`Trajectory.joint_path`."""
        return _splines_at(self.control, times, self.duration)


def _splines_at(control: FloatArray, times: FloatArray, duration: float) -> FloatArray:
    """Joint coordinates of k splines. Shapes (k, c, n), (k, t) and (k, t, n)."""
    out = np.empty((*times.shape, control.shape[2]))
    # Copied, since kernels would compile anew for arrays that are read-only.
    spline_rows(np.array(control, order="C"), np.array(times, order="C"), duration, out)
    return out
