"""Boxes that are drawn when an episode begins, clear of the joint motion behind its path."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Iterator, Sequence
from typing import Annotated

import numpy as np
import numpy.typing as npt

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.bodies import OBSTACLE
from ikgym.kernels.random_numbers import stream
from ikgym.obstacles.obstacle import Box, Obstacle
from ikgym.trajectories import Trajectory, joint_paths_of
from ikgym.validation import Bounds, FloatArray, Positive, Sizes, Vector, number

#: Where boxes are before they are drawn: so far below the base, in [m].
AWAY = 1e6
#: Most boxes of one obstacle.
MOST_BOXES = 1000
Count = Annotated[int, Bounds(at_least=1, at_most=MOST_BOXES)]


@dataclasses.dataclass(frozen=True, eq=False)
class RandomBoxes(Obstacle):
    """Upright boxes, drawn in each episode of a scenario whose path comes from a random joint motion.

    A box has edges of any length within a range, any angle about the vertical axis, and is near the motion: it is
    drawn around a random point of a random body at a random step, and drawn anew until it is near to the arm at that
    step and the motion is clear of it by the margin, at each step and between the steps. So each episode has a clear
    motion. Boxes may overlap each other. Collisions of the arm with itself are not checked. They are called `name 1`,
    `name 2`, … See :class:`Obstacle`.

    Args:
        lower: Least coordinates of the centres in the base frame, in [m]. Shape (3,).
        upper: Largest ones, in [m]. Shape (3,).
        smallest: Least edges in [m], above 0. Shape (3,).
        largest: Largest ones, in [m]. Shape (3,).
        count: The number of boxes.
        margin: The joint motion is nowhere nearer to a box, in [m].
        within: It comes nearer than that to each box, in [m]. At least the margin.

    Raises:
        InvalidInputError: A value is wrong, or a range the wrong way round.
    """

    lower: Vector
    upper: Vector
    smallest: Sizes
    largest: Sizes
    count: Count = dataclasses.field(default=10, kw_only=True)
    margin: Positive = 0.02
    within: Positive = 0.1
    motion: None = dataclasses.field(default=None, init=False)

    random: typing.ClassVar[bool] = True

    def _check(self) -> None:
        super()._check()
        for low, high in (("lower", "upper"), ("smallest", "largest")):
            least, most = getattr(self, low), getattr(self, high)
            if (least > most).any():
                raise InvalidInputError(
                    f"{low}, {high}: expected {low} <= {high}, got {least.tolist()} and {most.tolist()}."
                )
        number("within", self.within, at_least=self.margin)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the boxes."""
        return tuple(f"{self.name} {i + 1}" for i in range(self.count))

    def numbers(self) -> FloatArray:
        """Rows of boxes that are not drawn yet, out of the way of everything. Shape (count, 16)."""
        rows = np.zeros((self.count, OBSTACLE))
        rows[:, [0, 4, 8]] = 1.0
        rows[:, 11] = -AWAY
        return rows

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The smallest and the largest numbers that a box may have. Shapes (16,)."""
        turned = np.array([1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        low = np.concatenate([-turned, [1.0], self.lower, 0.5 * self.smallest, [0.0]])
        return low, np.concatenate([turned, [1.0], self.upper, 0.5 * self.largest, [0.0]])

    def draw(self, arm: Arm, paths: FloatArray, keys: npt.NDArray[np.uint64]) -> FloatArray:
        """The boxes of several episodes.

        Args:
            arm: The arm that has to be clear of them.
            paths: The joint motions, one row a step, in [rad] or [m]. Shape (k, t, n).
            keys: One an episode: the same key and motion give the same boxes. Shape (k,).

        Returns:
            Rows of :class:`ikgym.kernels.bodies.Surroundings`. Shape (k, count, 16).

        Raises:
            InvalidInputError: There is no room for a box in an episode.
        """
        from ikgym.kernels.bodies.clutter import TRIES, Drawing, draw_boxes  # other scenarios need none of its kernels

        out, found = np.empty((len(paths), self.count, OBSTACLE)), np.empty(len(paths), dtype=np.int64)
        checked = arm.bodies.surroundings([self]).checked[0]
        edges = self.smallest.copy(), self.largest.copy()
        drawing = Drawing(self.lower.copy(), self.upper.copy(), *edges, self.margin, self.within)
        draw_boxes(arm.chain, arm.bodies.shapes, checked, _bends(arm, paths), drawing, paths, keys, out, found)
        if found.min(initial=self.count) < self.count:
            raise InvalidInputError(
                f"obstacle {self.name!r}: expected room for {self.count} boxes that are {1e3 * self.margin:g} mm away "
                f"from the joint motion, found a place for {found.min()} of them in {TRIES} draws each; make them "
                "smaller, their region larger, or draw fewer."
            )
        return out

    def boxes(self, rows: FloatArray) -> tuple[Box, ...]:
        """Drawn boxes as fixed obstacles.

        Args:
            rows: Result of :meth:`draw` for one episode. Shape (count, 16).
        """
        return tuple(
            Box(name, row[9:12], 2.0 * row[12:15], row[:9].reshape(3, 3), ignored=self.ignored)
            for name, row in zip(self.names, rows, strict=True)
        )


def _bends(arm: Arm, paths: FloatArray) -> FloatArray:
    """Bounds of second derivatives: how far from the first joint a point of a body is at most, and 1. Shape (b,)."""
    prismatic, links = arm.chain.prismatic, np.linalg.norm(arm.offsets, axis=1)
    links[prismatic] += np.abs(paths[..., prismatic]).max(axis=(0, 1), initial=0.0)
    ends = np.maximum(np.linalg.norm(arm.bodies.starts, axis=1), np.linalg.norm(arm.bodies.ends, axis=1))
    far = [links[1:link].sum() + end for link, end in zip(arm.bodies.links, ends, strict=True)]
    return np.maximum(far, 1.0)


def drawn_rows(
    arm: Arm,
    obstacles: Sequence[Obstacle],
    first: FloatArray,
    episodes: Sequence[Trajectory],
    times: FloatArray,
    generators: Sequence[np.random.Generator],
) -> FloatArray:
    """The obstacles at the start of k episodes, from their rows before any is drawn. Shapes (k, o, 16), (o, 16).

    Generators, one an episode, are touched only where an obstacle is drawn; times are those of the steps in [s].
    """
    out = np.tile(first, (len(episodes), 1, 1))
    if not any(one.random for one in obstacles):
        return out
    keys = [int(rng.integers(2**63, dtype=np.uint64)) for rng in generators]
    paths = joint_paths_of(episodes, np.tile(times, (len(episodes), 1)))
    for i, (one, rows) in enumerate(_with_rows(obstacles)):
        if isinstance(one, RandomBoxes):
            seeds = np.array([stream(np.uint64(key), np.uint64(i)) for key in keys], dtype=np.uint64)
            out[:, rows] = one.draw(arm, paths, seeds)
    return out


def fix_boxes(obstacles: Sequence[Obstacle], numbers: FloatArray) -> tuple[Obstacle, ...]:
    """Obstacles of one episode, none of them random, from their rows of shape (o, 16)."""
    out: list[Obstacle] = []
    for one, rows in _with_rows(obstacles):
        out += one.boxes(numbers[rows]) if isinstance(one, RandomBoxes) else (one,)
    return tuple(out)


def bounds(obstacles: Sequence[Obstacle], low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The smallest and the largest numbers of obstacles in any episode, from those of obstacles that are not drawn."""
    low, high = low.copy(), high.copy()
    for one, rows in _with_rows(obstacles):
        if isinstance(one, RandomBoxes):
            low[rows], high[rows] = one.bounds()
    return low, high


def _with_rows(obstacles: Sequence[Obstacle]) -> Iterator[tuple[Obstacle, slice]]:
    at = 0
    for one in obstacles:
        yield one, slice(at, at + one.count)
        at += one.count
