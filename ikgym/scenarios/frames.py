"""The nominal frames of N episodes: whole tables, or for joint motions those that are near."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ikgym.kernels.kinematics import Chain
from ikgym.kernels.motions import Motions
from ikgym.kernels.threads import in_chunks
from ikgym.scenarios.scenario import Scenario
from ikgym.trajectories import JointMotions, Trajectory
from ikgym.validation import FloatArray

Integers = npt.NDArray[np.int64]

# Rows worth a thread: below, handing over costs more than it saves.
GRAIN = 4
# Rows whose frames are computed at a time: their intermediate results stay small.
PIECE = 64


class NominalFrames:
    """All frames of N episodes; where the scenario is fixed they share one table.

    Args:
        scenario: The scenario.
        rows: N.
        ahead: Steps ahead that are shown, rising.

    Attributes:
        point: Which point is the target after k steps, and its place in a table. Shape (steps + furthest preview + 1,).
        shape: Of the tables.
    """

    def __init__(self, scenario: Scenario, rows: int, ahead: tuple[int, ...]) -> None:
        self._scenario = scenario
        self.point = self.slots = scenario.points(ahead)
        width = 12 if scenario.task.has_orientation else 3
        self.shape = (rows if scenario.random else 1, int(self.point[-1]) + 1, width)

    def allocate(self) -> FloatArray:
        """The tables, of :attr:`shape`, when there is memory for them; that of a fixed scenario is filled."""
        tables = np.zeros(self.shape)
        self._episodes: list[Trajectory] = [self._scenario.trajectory] * len(tables)
        if not self._scenario.random:
            self.begin(tables, np.zeros(1, dtype=np.int64), self._episodes)
        return tables

    def begin(self, tables: FloatArray, rows: Integers, episodes: Sequence[Trajectory]) -> None:
        """Begins new episodes in some rows. Shape (k,)."""
        for row, episode in zip(rows.tolist(), episodes, strict=True):
            self._episodes[row] = episode
        points = np.arange(self.shape[1])

        def work(start: int, stop: int) -> None:
            for part in range(start, stop, PIECE):
                some = rows[part : min(part + PIECE, stop)]
                some_episodes = [self._episodes[row] for row in some.tolist()]
                tables[some] = self._scenario.frames_of(
                    some_episodes, np.broadcast_to(points, (len(some), len(points)))
                )

        in_chunks(work, len(rows), GRAIN)

    def positions(self, row: int) -> FloatArray:
        """The nominal positions of a row's episode in [m], one a step. Shape (steps + 1, 3)."""
        point = self.point[: self._scenario.steps + 1]
        episode = self._episodes[row if self._scenario.random else 0]
        positions: FloatArray = self._scenario.frames(episode, int(point[-1]) + 1)[point, -3:]
        return positions


class MotionFrames:
    """Tables of frames that :func:`ikgym.kernels.motions.complete` fills in, so that an episode begins in no time.

    Args:
        scenario: The scenario.
        motions: Motions that its trajectory draws.
        rows: N.
        ahead: Steps ahead that are shown, rising.
        count: For how many steps frames are computed at once.
    """

    def __init__(
        self, scenario: Scenario, motions: JointMotions, rows: int, ahead: tuple[int, ...], count: int
    ) -> None:
        self._scenario, self._motions = scenario, motions
        self.point = scenario.points(ahead)
        self._points, width = int(self.point[-1]) + 1, 12 if scenario.task.has_orientation else 3
        # From the target to the furthest that is shown: those of whole episodes would not stay in the cache.
        self.shape = (rows, ahead[-1] + count, width)
        self._preview = np.array(ahead, dtype=np.int64)

    def allocate(self) -> FloatArray:
        """The tables, of :attr:`shape`, when there is memory for them."""
        rows, slots, _ = self.shape
        self._motions = self._motions.blank(rows)
        self._first, self._known = np.zeros(rows, dtype=np.int64), np.full((rows, slots), -1)
        return np.zeros(self.shape)

    @property
    def slots(self) -> Integers:
        """Index of the target after k steps in a table. Shape (steps + furthest preview + 1,)."""
        return self.point % self.shape[1]

    def begin(self, tables: FloatArray, rows: Integers, episodes: Sequence[Trajectory]) -> None:
        """Begins new episodes; the arguments are those of `NominalFrames.begin`."""
        del tables
        self._motions.parameters[rows] = episodes.parameters  # type: ignore[attr-defined]  # JointMotions
        self._first[rows] += self._points

    def arguments(self) -> tuple[Chain, Motions]:
        """The first arguments of the kernel."""
        motions, places = self._motions, (self._first, self.point, self._preview, self._known)
        return self._scenario.model.chain, Motions(motions.parameters, motions.duration, self._scenario.dt, *places)

    def positions(self, row: int) -> FloatArray:
        """The nominal positions of a row's episode in [m], one a step. Shape (steps + 1, 3)."""
        point = self.point[: self._scenario.steps + 1]
        positions: FloatArray = self._scenario.frames(self._motions[row], int(point[-1]) + 1)[point, -3:]
        return positions


def frames_of_rows(scenario: Scenario, rows: int, ahead: tuple[int, ...], count: int) -> MotionFrames | NominalFrames:
    """The nominal frames of N episodes, see the two classes."""
    motions = scenario.trajectory.samples([])
    if isinstance(motions, JointMotions):
        return MotionFrames(scenario, motions, rows, ahead, count)
    return NominalFrames(scenario, rows, ahead)
