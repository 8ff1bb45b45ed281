"""Another trajectory, together with a joint motion along it."""

from __future__ import annotations

import dataclasses
import functools
from typing import Annotated

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.trajectories.splines import CubicSpline
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import LARGEST, FloatArray, Numbers, float_array, frozen_array


@dataclasses.dataclass(frozen=True, eq=False)
class JointPath(Trajectory):
    """The poses of another trajectory, and a joint motion that leads through them.

    The joint motion is a natural cubic spline in time, which ``follow_nominal`` plays and others may ignore: they are
    given the poses of the other trajectory, exactly.

    Args:
        trajectory: The other trajectory; not a random one.
        times: Its times in [s], from 0 on, rising. Shape (k,).
        q: Joint coordinates at these times, in [rad] or [m]. Shape (k, n).

    Raises:
        InvalidInputError: The trajectory is random, the times do not rise from 0, or a shape is wrong.
    """

    trajectory: Trajectory
    times: Numbers
    q: Annotated[FloatArray, functools.partial(frozen_array, shape=(None, None), at_most=LARGEST)]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.trajectory.random:
            raise InvalidInputError(f"trajectory: expected one that is not random, got {self.trajectory!r}.")
        times = self.times
        if len(times) < 2 or times[0] != 0.0 or (np.diff(times) <= 0.0).any():
            raise InvalidInputError("times: expected at least two times in [s] that rise from 0.")
        float_array("q", self.q, (len(times), None))
        self._settle(has_orientation=self.trajectory.has_orientation)

    @property
    def duration(self) -> float:
        """The time of the last joint coordinates, in [s]."""
        return float(self.times[-1])

    def joint_path(self, times: FloatArray) -> FloatArray:
        """See :meth:`Trajectory.joint_path`."""
        return self._spline(times)

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """See :meth:`Trajectory.frames`; those of the other trajectory."""
        return self.trajectory.frames(times, model)

    def joint_bound(self) -> FloatArray:
        """See :meth:`Trajectory.joint_bound`; values and slopes at the knots bound a cubic (Bézier points)."""
        reach = np.diff(self.times, append=self.times[-1], prepend=0.0)
        widest = np.maximum(reach[1:], reach[:-1])[:, None]
        bound: FloatArray = (np.abs(self.q) + widest / 3.0 * np.abs(self._spline.slopes)).max(axis=0)
        return bound

    def reach(self, times: FloatArray, model: Arm) -> float:
        """See :meth:`Trajectory.reach`."""
        return self.trajectory.reach(times, model)

    @functools.cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline.through(self.times, self.q, at_rest=False)
