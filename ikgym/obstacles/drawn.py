"""Obstacles that are drawn when an episode begins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ikgym.arms import Arm
from ikgym.kernels.random_numbers import stream
from ikgym.obstacles.obstacle import Obstacle
from ikgym.obstacles.random_boxes import RandomBoxes
from ikgym.trajectories import Trajectory, joint_paths_of
from ikgym.validation import FloatArray


def rows(
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
    out, at = np.tile(first, (len(episodes), 1, 1)), 0
    if not any(one.random for one in obstacles):
        return out
    keys = [int(rng.integers(2**63, dtype=np.uint64)) for rng in generators]
    paths = joint_paths_of(episodes, np.tile(times, (len(episodes), 1)))
    for i, one in enumerate(obstacles):
        if isinstance(one, RandomBoxes):
            own = np.array([stream(np.uint64(key), np.uint64(i)) for key in keys], dtype=np.uint64)
            out[:, at : at + one.count] = one.draw(arm, paths, own)
        at += one.count
    return out


def fixed(obstacles: Sequence[Obstacle], numbers: FloatArray) -> tuple[Obstacle, ...]:
    """Obstacles of one episode, none of them random, from their rows of shape (o, 16)."""
    out: list[Obstacle] = []
    at = 0
    for one in obstacles:
        out += one.boxes(numbers[at : at + one.count]) if isinstance(one, RandomBoxes) else (one,)
        at += one.count
    return tuple(out)


def bounds(obstacles: Sequence[Obstacle], low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The smallest and the largest numbers of obstacles in any episode, from those of obstacles that are not drawn."""
    low, high, at = low.copy(), high.copy(), 0
    for one in obstacles:
        if isinstance(one, RandomBoxes):
            low[at : at + one.count], high[at : at + one.count] = one.bounds()
        at += one.count
    return low, high
