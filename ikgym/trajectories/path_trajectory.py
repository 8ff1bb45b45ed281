"""A path in space, followed from rest to rest."""

from __future__ import annotations

import dataclasses

import numpy as np

from ikgym.arms import Arm
from ikgym.trajectories.orientations import Orientation
from ikgym.trajectories.paths import Path
from ikgym.trajectories.time_laws import TimeLaw
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class PathTrajectory(Trajectory):
    """A path, the time law by which it is followed, and the orientation of the tool on the way.

    It begins at rest and ends at rest, where it stays.

    Args:
        path: Where the tool goes.
        time_law: How fast.
        orientation: How the tool is turned; None for a path of positions alone.

    Raises:
        InvalidInputError: A part is something else, the duration of the time law too short, or the orientation does
            not suit the path.
    """

    path: Path
    time_law: TimeLaw
    orientation: Orientation | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.time_law.time(self.path)
        if self.orientation is not None:
            self.orientation.check(self.path)
        self._settle(has_orientation=self.orientation is not None)

    @property
    def duration(self) -> float:
        """The time from rest to rest, in [s]."""
        return self.time_law.time(self.path)

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """See :meth:`Trajectory.frames`."""
        del model
        s = self.time_law.travel(times, self.path)
        points = self.path.along(s)[0]
        if self.orientation is None:
            return points
        return np.hstack([self.orientation.rotations(self.path, s).reshape(-1, 9), points])
