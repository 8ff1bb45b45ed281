"""The reference trajectory of a scenario, step by step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.simulation import nominal_rows
from ikgym.scenarios import checks
from ikgym.scenarios.preview import Preview, furthest
from ikgym.tasks import Task
from ikgym.trajectories import Trajectory, frames_of
from ikgym.validation import FloatArray


class Reference:
    """Base of :class:`ikgym.Scenario`: the target after each step of an episode."""

    name: str
    task: Task
    trajectory: Trajectory
    model: Arm
    dt: float
    steps: int
    iterations_per_point: int | tuple[int, ...]

    @property
    def random(self) -> bool:
        """Whether the reset seed chooses the trajectory."""
        return self.trajectory.random

    def nominal(self, seed: int | None = None, preview: Preview = 0) -> FloatArray:
        """The nominal task coordinates X^N(0), X^N(1), … of an episode, one row a step.

        Args:
            seed: The reset seed; needed where the scenario is random.
            preview: Steps past the end of the episode, as in the environment.

        Returns:
            Task coordinates. Shape (steps + preview + 1, m).

        Raises:
            InvalidInputError: The scenario is random and there is no seed.
        """
        points = self.points(preview)
        out = np.empty((points[-1] + 1, self.task.size))
        nominal_rows(self.task.kind, self.frames(self.episode(seed), len(out)), out)
        return out[points]

    def nominal_joint_path(self, seed: int | None = None, preview: Preview = 0) -> FloatArray | None:
        """The nominal joint coordinates of an episode, one row a step; None for a Cartesian trajectory.

        Args:
            seed: The reset seed; needed where the scenario is random.
            preview: Steps past the end of the episode.

        Returns:
            Joint coordinates in [rad] or [m]. Shape (steps + preview + 1, n).

        Raises:
            InvalidInputError: The scenario is random and there is no seed.
        """
        points = self.points(preview)
        path = self.episode(seed).joint_path(self.times(int(points[-1]) + 1))
        return None if path is None else path[points]

    def episode(self, seed: int | None = None) -> Trajectory:
        """The reference trajectory of an episode.

        Args:
            seed: The reset seed; needed where the scenario is random.

        Raises:
            InvalidInputError: The scenario is random and there is no seed.
        """
        if self.random and seed is None:
            raise InvalidInputError(f"Scenario {self.name!r} is random: a seed says which episode is meant.")
        return self.trajectory.sample(seeding.np_random(seed)[0]) if self.random else self.trajectory

    def points(self, preview: Preview = 0) -> npt.NDArray[np.int64]:
        """Numbers of the nominal points that are the target after k steps.

        Args:
            preview: Steps past the end of the episode.

        Returns:
            Numbers of points. Shape (steps + preview + 1,).

        Raises:
            InvalidInputError: There is no memory for so many.
        """
        last = self.steps + furthest(preview)
        checks.check_memory_of_points(last + 1, self.model.joints)
        # Points that are held for longer than the episode are held to its end.
        *first, usual = (min(held, last + 1) for held in self._held())
        ends = np.cumsum(first, dtype=np.int64)
        rest = (last - (int(ends[-1]) if len(ends) else 0)) // usual + 1
        lengths = np.concatenate([np.array(first, dtype=np.int64), np.full(max(rest, 0), usual)])
        return np.concatenate([[0], np.repeat(np.arange(1, len(lengths) + 1), lengths)])[: last + 1]

    def counted(self) -> npt.NDArray[np.bool_]:
        """Whether errors and costs count after k steps: at the last step of each point, and of the episode.

        Returns:
            Truth values; the start does not count. Shape (steps + 1,).
        """
        points = self.points(1)
        out: npt.NDArray[np.bool_] = points[1:] != points[:-1]
        out[0], out[-1] = False, True
        return out

    def frames(self, trajectory: Trajectory, points: int) -> FloatArray:
        """The nominal frames of one episode, one row a point; see :meth:`Trajectory.frames`.

        Args:
            trajectory: Trajectory of the episode.
            points: Number of points.

        Returns:
            Frames. Shape (points, 12), or (points, 3) where the task has no orientation.
        """
        frames = trajectory.frames(self.times(points), self.model)
        return np.ascontiguousarray(frames if self.task.has_orientation else frames[:, -3:])

    def frames_of(self, episodes: Sequence[Trajectory], points: npt.NDArray[np.int64]) -> FloatArray:
        """The nominal frames of several episodes, each at points of its own; bit for bit those of :meth:`frames`.

        Args:
            episodes: Trajectories of the k episodes.
            points: Numbers of points. Shape (k, p).

        Returns:
            Frames. Shape (k, p, 12), or (k, p, 3) where the task has no orientation.
        """
        frames = frames_of(episodes, points.astype(np.float64) * self.dt, self.model)
        return frames if self.task.has_orientation else frames[..., -3:]

    def times(self, points: int) -> FloatArray:
        """Times of the nominal points in [s]. Shape (points,)."""
        return np.arange(points, dtype=np.float64) * self.dt

    def _held(self) -> tuple[int, ...]:
        held = self.iterations_per_point
        return tuple(held) if isinstance(held, (tuple, list)) else (held,)
