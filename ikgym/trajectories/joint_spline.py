"""A smooth joint motion from rest to rest."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.trajectories.batch import JointMotions, paths_of
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import LARGEST, FloatArray, Positive, frozen_array

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
    duration: Positive

    def __post_init__(self) -> None:
        super().__post_init__()
        control = frozen_array("control", self.control, (None, None), at_most=LARGEST)
        if len(control) < 6:
            raise InvalidInputError(f"control: expected at least 6 control points, got {len(control)}.")
        ends = control[[1, 2, -2, -3]] - control[[0, 0, -1, -1]]
        if ends.any():
            raise InvalidInputError("control: expected the first three to be the same and the last three, for rest.")
        self._settle(control=control)

    def joint_path(self, times: FloatArray) -> FloatArray:
        """See :meth:`Trajectory.joint_path`."""
        path: FloatArray = paths_of(self.control[None], times[None], self.duration)[0]
        return path

    def joint_bound(self) -> FloatArray:
        """See :meth:`Trajectory.joint_bound`."""
        bound: FloatArray = np.abs(self.control).max(axis=0) * (1.0 + SLACK)
        return bound


class JointSplines(JointMotions):
    """Several splines; the parameters are their control points in [rad] or [m], as those of :class:`JointSpline`."""

    def __getitem__(self, row: Any) -> Any:
        return JointSpline(self.parameters[row], self.duration)
