"""Another trajectory in another time."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.trajectories.paths.path import check_count
from ikgym.trajectories.splines import CubicSpline
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import FloatArray, Numbers, float_array


@dataclasses.dataclass(frozen=True, eq=False)
class RetimedTrajectory(Trajectory):
    """The poses of another trajectory at other times; the path in space stays exactly as it was.

    The time of the other trajectory is a piecewise cubic function of the new one, with given values and slopes. It
    stays where it is from the last time on.

    Args:
        trajectory: The other trajectory; not a random one.
        times: New times in [s], from 0 on, rising. Shape (k,).
        progress: Times of the other trajectory at these, in [s], from 0 on, never falling. Shape (k,).
        rates: Their derivatives, at least 0: 1 is the speed of before. Shape (k,).

    Raises:
        InvalidInputError: The trajectory is random, there are fewer than two times or too many, a shape is wrong, or
            values do not rise.
    """

    trajectory: Trajectory
    times: Numbers
    progress: Numbers
    rates: Numbers

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.trajectory.random:
            raise InvalidInputError(f"trajectory: expected one that is not random, got {self.trajectory!r}.")
        check_count("times", self.times)
        for name in ("progress", "rates"):
            float_array(name, getattr(self, name), self.times.shape)
        for name, least in {
            "times": np.diff(self.times),
            "progress": np.diff(self.progress),
            "rates": self.rates,
        }.items():
            if (least < 0.0).any() or (name == "times" and not least.all()):
                raise InvalidInputError(f"{name}: expected numbers that {_WANTED[name]}, got {least.min():g} as one.")
        for name in ("times", "progress"):
            if getattr(self, name)[0] != 0.0:
                raise InvalidInputError(f"{name}: expected 0 s as the first, got {getattr(self, name)[0]:g} s.")
        self._settle(has_orientation=self.trajectory.has_orientation)

    @property
    def duration(self) -> float:
        """The time to the end, in [s]."""
        return float(self.times[-1])

    def base_times(self, times: FloatArray) -> FloatArray:
        """The times of the other trajectory in [s]. Shapes (k,)."""
        return np.clip(self._spline(times)[:, 0], 0.0, self.progress[-1])

    def joint_path(self, times: FloatArray) -> FloatArray | None:
        """See :meth:`Trajectory.joint_path`."""
        return self.trajectory.joint_path(self.base_times(times))

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """See :meth:`Trajectory.frames`."""
        return self.trajectory.frames(self.base_times(times), model)

    def joint_bound(self) -> FloatArray | None:
        """See :meth:`Trajectory.joint_bound`."""
        return self.trajectory.joint_bound()

    def first_joints(self) -> FloatArray | None:
        """See :meth:`Trajectory.first_joints`."""
        return self.trajectory.first_joints()

    def first_joints_bound(self) -> FloatArray | None:
        """See :meth:`Trajectory.first_joints_bound`."""
        return self.trajectory.first_joints_bound()

    def check(self, model: Arm) -> None:
        """See :meth:`Trajectory.check`."""
        self.trajectory.check(model)

    @functools.cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.times, self.progress[:, None], self.rates[:, None])


_WANTED = {"times": "rise", "progress": "never fall", "rates": "are at least 0"}
