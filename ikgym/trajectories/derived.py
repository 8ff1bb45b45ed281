"""Trajectories with the poses of another one: in another time, or together with a joint motion along it."""

from __future__ import annotations

import dataclasses
import functools
from typing import Annotated

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.trajectories.paths.path import check_count
from ikgym.trajectories.splines import CubicSpline
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import LARGEST, FloatArray, Numbers, float_array, frozen_array

_WANTED = {"times": "rise", "progress": "never fall", "rates": "are at least 0"}


@dataclasses.dataclass(frozen=True, eq=False)
class DerivedTrajectory(Trajectory):
    """Base of trajectories with the poses of another one.

    Args:
        trajectory: The other trajectory; not a random one.
        times: Times in [s], from 0 on, rising. Shape (k,), k >= 2.
    """

    trajectory: Trajectory
    times: Numbers

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.trajectory.random:
            raise InvalidInputError(f"trajectory: expected one that is not random, got {self.trajectory!r}.")
        check_count("times", self.times)
        self._check_rise("times")
        self._settle(has_orientation=self.trajectory.has_orientation)

    def _check_rise(self, name: str) -> None:
        """Checks that numbers begin at 0 and rise, which times do strictly."""
        numbers = getattr(self, name)
        least = np.diff(numbers).min()
        if least < 0.0 or (name == "times" and least == 0.0):
            raise InvalidInputError(f"{name}: expected numbers that {_WANTED[name]}, got {least:g} as one.")
        if numbers[0] != 0.0:
            raise InvalidInputError(f"{name}: expected 0 s as the first, got {numbers[0]:g} s.")

    @property
    def duration(self) -> float:
        """The last of the times, in [s]."""
        return float(self.times[-1])

    def check(self, model: Arm) -> None:
        """See :meth:`Trajectory.check`; the other trajectory suits the arm, too."""
        super().check(model)
        self.trajectory.check(model)


@dataclasses.dataclass(frozen=True, eq=False)
class RetimedTrajectory(DerivedTrajectory):
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

    progress: Numbers
    rates: Numbers

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("progress", "rates"):
            float_array(name, getattr(self, name), self.times.shape)
        self._check_rise("progress")
        if (self.rates < 0.0).any():
            raise InvalidInputError(
                f"rates: expected numbers that {_WANTED['rates']}, got {self.rates.min():g} as one."
            )

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

    @functools.cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.times, self.progress[:, None], self.rates[:, None])


@dataclasses.dataclass(frozen=True, eq=False)
class JointPath(DerivedTrajectory):
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

    q: Annotated[FloatArray, functools.partial(frozen_array, shape=(None, None), at_most=LARGEST)]

    def __post_init__(self) -> None:
        super().__post_init__()
        float_array("q", self.q, (len(self.times), None))

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
