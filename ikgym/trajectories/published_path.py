"""Paths of problems that others published, at a waypoint a period."""

from __future__ import annotations

import dataclasses
import functools
import typing

import numpy as np

from ikgym import problems
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError, list_names
from ikgym.trajectories.timed_waypoints import TimedWaypoints
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import FloatArray, Positive, shorten


@dataclasses.dataclass(frozen=True, eq=False)
class PublishedPath(Trajectory):
    """Through the waypoints of a problem of :mod:`ikgym.problems`, one a period, as :class:`TimedWaypoints` do it.

    The waypoints are met at multiples of the period; the motion between them, and the rest at both ends, are not
    published. Episodes begin at the first published start where there is one.

    Args:
        problem: Its name.
        period: From waypoint to waypoint, in [s].

    Raises:
        UnknownNameError: There is no such problem; the message has the nearest name.
        InvalidInputError: The period is no number above 0.
    """

    problem: str
    period: Positive

    def __post_init__(self) -> None:
        super().__post_init__()
        problems.get(self.problem)

    @property
    def duration(self) -> float:
        """The time of the last waypoint, in [s]."""
        return self._timed.duration

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """See :meth:`Trajectory.frames`."""
        return self._timed.frames(times, model)

    def first_joints(self) -> FloatArray | None:
        """See :meth:`Trajectory.first_joints`."""
        starts = problems.get(self.problem).starts
        return starts[0] if len(starts) else None

    def first_joints_bound(self) -> FloatArray | None:
        """See :meth:`Trajectory.first_joints_bound`."""
        first = self.first_joints()
        return None if first is None else np.abs(first)

    @functools.cached_property
    def _timed(self) -> TimedWaypoints:
        positions, quaternions, *_ = problems.get(self.problem)
        return TimedWaypoints(self.period * np.arange(len(positions), dtype=np.float64), positions, quaternions)


@dataclasses.dataclass(frozen=True, eq=False)
class RandomPublishedPath(Trajectory):
    """One of the problems whose names begin with a text, each as likely, as a :class:`PublishedPath`.

    Args:
        family: The beginning of the names. All these problems have starts.
        period: From waypoint to waypoint, in [s].

    Raises:
        InvalidInputError: There is no such problem, one has no start, or the period is no number above 0.
    """

    family: str
    period: Positive
    random: typing.ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        members = problems.names(self.family) if isinstance(self.family, str) else ()
        if not members or not all(len(problems.get(name).starts) for name in members):
            raise InvalidInputError(
                f"family: expected the beginning of names of problems with starts, got {shorten(self.family)}; "
                f"available: {list_names(problems.names())}."
            )

    def sample(self, rng: np.random.Generator) -> PublishedPath:
        """See :meth:`Trajectory.sample`."""
        members = problems.names(self.family)
        return PublishedPath(members[rng.integers(len(members))], self.period)

    def first_joints_bound(self) -> FloatArray:
        """See :meth:`Trajectory.first_joints_bound`; true for all that may be drawn."""
        starts = [problems.get(name).starts[0] for name in problems.names(self.family)]
        bound: FloatArray = np.abs(starts).max(axis=0)
        return bound

    def reach(self, times: FloatArray, model: Arm) -> float:
        """See :meth:`Trajectory.reach`; true for all that may be drawn.

        Slopes of a cubic spline at evenly spaced knots do not exceed 3 times the largest difference quotient, so that
        between two knots it leaves the line between them by no more than 32/27 of the longest step, less than 2.
        """
        del times, model
        return max(_reach(problems.get(name).positions) for name in problems.names(self.family))


def _reach(positions: FloatArray) -> float:
    longest = np.linalg.norm(np.diff(positions, axis=0), axis=1).max()
    return float(np.linalg.norm(positions, axis=1).max() + 2.0 * longest)
