"""The nominal frames of N episodes: whole tables, blocks computed on the way, or each one when it is needed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.parallel import in_chunks
from ikgym.scenarios.scenario import Scenario
from ikgym.trajectories import JointMotions, Trajectory
from ikgym.validation import FloatArray

Integers = npt.NDArray[np.int64]

# Most memory for the nominal frames of all rows, in bytes: of many long episodes only the next frames are kept.
MEMORY = 2**26
# Rows worth a thread of their own: below, handing over costs more than it saves.
GRAIN = 4
# Rows whose frames are computed at a time: their intermediate results stay small.
PIECE = 64


class NominalFrames:
    """The frames that N episodes need soon; where the scenario is fixed they share one table.

    Args:
        scenario: The scenario.
        rows: N.
        ahead: Steps ahead that are shown, rising.
        memory: Most memory for the frames of all rows, in bytes. Those of random episodes that would take more are
            computed block by block on the way; a block is never shorter than the preview looks ahead.
    """

    def __init__(self, scenario: Scenario, rows: int, ahead: tuple[int, ...], memory: int) -> None:
        self._scenario = scenario
        self.point = scenario.points(ahead)
        width = 12 if scenario.task.has_orientation else 3
        points = int(self.point[-1]) + 1
        tables = rows if scenario.random else 1
        affordable = memory // (8 * width * rows) if scenario.random else points
        # Rows know all of their points, or two blocks of them: the next one takes the place of the one before.
        self._block = points if points <= affordable else min(points, max(affordable // 2, ahead[-1]))
        self.in_blocks = self._block < points
        self.shape = (tables, self._block * (2 if self.in_blocks else 1), width)
        self._last_block = self.point[ahead[-1] :] // self._block

    def allocate(self) -> FloatArray:
        """The tables, of :attr:`shape`, when there is memory for them; that of a fixed scenario is filled."""
        tables = np.zeros(self.shape)
        self._blocks_known = np.zeros(len(tables), dtype=np.int64)
        self._episodes: list[Trajectory] = [self._scenario.trajectory] * len(tables)
        if not self._scenario.random:
            self._know(tables, np.zeros(1, dtype=np.int64))
        return tables

    @property
    def slots(self) -> Integers:
        """Index of the target after k steps in a table. Shape (steps + furthest preview + 1,)."""
        return self.point % self.shape[1]

    def begin(self, tables: FloatArray, rows: Integers, episodes: Sequence[Trajectory], steps: Integers) -> None:
        """Begins new episodes of a random scenario in some rows, entered after some steps. Shapes (k,)."""
        for row, episode in zip(rows.tolist(), episodes, strict=True):
            self._episodes[row] = episode
        self._blocks_known[rows] = self.point[steps] // self._block
        self.look_ahead(tables, rows, steps)

    def look_ahead(self, tables: FloatArray, rows: Integers, steps: Integers) -> None:
        """Sees to it that rows know all frames that they need after so many steps. Shapes (k,)."""
        last = self._last_block[steps]
        while len(late := rows[last >= self._blocks_known[rows]]):
            self._know(tables, late)

    def positions(self, row: int) -> FloatArray:
        """The nominal positions of a row's episode in [m], one a step. Shape (steps + 1, 3)."""
        point = self.point[: self._scenario.steps + 1]
        episode = self._episodes[row if self._scenario.random else 0]
        positions: FloatArray = self._scenario.frames(episode, int(point[-1]) + 1)[point, -3:]
        return positions

    def _know(self, tables: FloatArray, rows: Integers) -> None:
        """Computes the next block of some rows."""
        first, ahead = self._blocks_known[rows] * self._block, np.arange(self._block)

        def work(start: int, stop: int) -> None:
            for part in range(start, stop, PIECE):
                some = slice(part, min(part + PIECE, stop))
                points = first[some, None] + ahead
                episodes = [self._episodes[row] for row in rows[some].tolist()]
                tables[rows[some, None], points % self.shape[1]] = self._scenario.frames_of(episodes, points)

        in_chunks(work, len(rows), GRAIN)
        self._blocks_known[rows] += 1


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

    def begin(self, tables: FloatArray, rows: Integers, episodes: Sequence[Trajectory], steps: Integers) -> None:
        """Begins new episodes; the arguments are those of `NominalFrames.begin`."""
        del tables, steps
        self._motions.parameters[rows] = episodes.parameters  # type: ignore[attr-defined]  # JointMotions
        self._first[rows] += self._points

    def arguments(self) -> tuple[Any, ...]:
        """The first arguments of the kernel."""
        motions, scenario = self._motions, self._scenario
        shown = motions.parameters, motions.duration, scenario.dt, self._first, self.point, self._preview, self._known
        return *scenario.model.chain, *shown

    def positions(self, row: int) -> FloatArray:
        """The nominal positions of a row's episode in [m], one a step. Shape (steps + 1, 3)."""
        point = self.point[: self._scenario.steps + 1]
        positions: FloatArray = self._scenario.frames(self._motions[row], int(point[-1]) + 1)[point, -3:]
        return positions


def frames_of_rows(
    scenario: Scenario, rows: int, ahead: tuple[int, ...], memory: int, count: int
) -> MotionFrames | NominalFrames:
    """The nominal frames of N episodes, see the two classes."""
    motions = scenario.trajectory.samples([])
    if isinstance(motions, JointMotions):
        return MotionFrames(scenario, motions, rows, ahead, count)
    return NominalFrames(scenario, rows, ahead, memory)
