"""Waypoints with a time each."""

from __future__ import annotations

import dataclasses
import functools
from typing import Annotated

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.trajectories.orientations import Quaternions, matrices
from ikgym.trajectories.paths.path import check_count
from ikgym.trajectories.splines import CubicSpline
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import LARGEST, FloatArray, Numbers, float_array, frozen_array


@dataclasses.dataclass(frozen=True, eq=False)
class TimedWaypoints(Trajectory):
    """Through waypoints at given times, by a cubic spline in time, from rest to rest.

    The velocity is continuous everywhere and 0 at both ends, the acceleration is continuous in between.

    Args:
        times: In [s], from 0 on, rising. Shape (k,).
        positions: In [m]. Shape (k, 3).
        quaternions: Unit quaternions w, x, y, z, interpolated by a spline that is normalised; None for positions
            alone. Shape (k, 4).

    Raises:
        InvalidInputError: There are fewer than two waypoints or too many, the times do not rise, a shape is wrong, or a
            quaternion has not the length 1.
    """

    times: Numbers
    positions: Annotated[FloatArray, functools.partial(frozen_array, shape=(None, 3), at_most=LARGEST)]
    quaternions: Quaternions | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        times = self.times
        check_count("times", times)
        if times[0] < 0.0:
            raise InvalidInputError(f"times: expected times from 0 on, got {times[0]:g} s as the first.")
        if (np.diff(times) <= 0.0).any():
            i = int(np.argmax(np.diff(times) <= 0.0))
            raise InvalidInputError(
                f"times: expected times that rise, got {times[i]:g} s and {times[i + 1]:g} s as numbers {i} and "
                f"{i + 1}."
            )
        float_array("positions", self.positions, (len(times), 3))
        if self.quaternions is not None:
            float_array("quaternions", self.quaternions, (len(times), 4))
        self._settle(has_orientation=self.quaternions is not None)

    @property
    def duration(self) -> float:
        """The time of the last waypoint, in [s]."""
        return float(self.times[-1])

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """See :meth:`Trajectory.frames`."""
        del model
        values = self._spline(times)
        if self.quaternions is None:
            return values
        return np.hstack([matrices(values[:, 3:]).reshape(-1, 9), values[:, :3]])

    @functools.cached_property
    def _spline(self) -> CubicSpline:
        values = self.positions if self.quaternions is None else np.hstack([self.positions, self.quaternions])
        return CubicSpline.through(self.times, values, at_rest=True)
