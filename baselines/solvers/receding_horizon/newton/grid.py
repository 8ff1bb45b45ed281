"""The time grid of a joint path: knots ahead, and how much each of them counts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.jit import expanded, inner, uncounted

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class Grid(NamedTuple):
    """K knots; the path is linear between two, and begins where the arm is.

    Attributes:
        at: Steps from now to each knot, at least 1 and rising. Shape (K,).
        length: Steps of the block that ends in the knot. Shape (K,).
        tracking: Number of tracking stage costs that the knot represents. Shape (K,).
        velocity: Number of velocity stage costs that the block represents. Shape (K,).
    """

    at: Integers
    length: Floats
    tracking: Floats
    velocity: Floats


def offsets(steps: int, move_blocks: int | None) -> Integers:
    """Steps from now to the knots of a horizon: two blocks of one step, then lengths that grow geometrically.

    Args:
        steps: Steps of the horizon.
        move_blocks: K; None, or as many as there are steps, for a knot at each step.

    Returns:
        Whole numbers, rising by at least 1, the last one ``steps``. Shape (K,).
    """
    blocks = move_blocks
    if blocks is None or blocks >= steps:
        return np.arange(1, steps + 1)
    if blocks <= 2:
        return np.array([1, steps][:blocks]) if blocks == 2 else np.array([steps])
    growing = np.arange(1, blocks - 1)
    low, high = 1.0, float(steps) ** (1.0 / (blocks - 2))  # at which the last block alone is too long
    for _ in range(200):
        ratio = 0.5 * (low + high)
        low, high = (ratio, high) if np.sum(ratio**growing) < steps - 2 else (low, ratio)
    ends = 2.0 + np.cumsum(low**growing)
    # Rounded, no block shorter than a step, and the last where the horizon ends.
    out = np.concatenate([[1, 2], np.rint(ends).astype(np.int64)])
    out = np.maximum(out, np.arange(1, blocks + 1))
    cut_off: Integers = np.minimum(out, steps - blocks + np.arange(1, blocks + 1))
    return cut_off


def evenly_growing_offsets(steps: int, growth: float, longest: float) -> Integers:
    """Steps from now to the knots of a horizon: each block is longer than the one before by the same number of steps.

    A horizon of some seconds needs fewer knots than with geometric growth, whose last blocks skip whole oscillations
    while most of its knots lie in the first tenth.

    Args:
        steps: Steps of the horizon.
        growth: By how many steps a block is longer than the one before, behind two blocks of one step.
        longest: Steps of a block at most.

    Returns:
        Whole numbers, rising by at least 1, the last one ``steps``. Shape (K,).
    """
    lengths = np.minimum(1.0 + growth * np.arange(steps), longest)
    out = 1 + np.rint(np.cumsum(np.append(0.0, lengths))).astype(np.int64)
    before_the_end: Integers = np.append(out[out < steps], steps)
    return before_the_end


@uncounted
def cut(at, steps, terminal, grid):
    """The grid of the knots ``at``, cut so that none lies more than ``steps`` ahead.

    A block of h steps is weighted by the trapezoidal rule: the tracking costs of its steps are (h - 1) / 2 times that
    of the knot before and (h + 1) / 2 times that of the knot at its end, which is exact for blocks of one step. The
    joint velocity is the same all along a block, so that its cost counts h times.

    Args:
        at: Steps from now to the knots of the whole horizon. Shape (K,).
        steps: Steps ahead of the last knot at most; at least 1.
        terminal: Factor of the tracking cost of the last knot, where the horizon is not cut.
        grid: Receives the grid in its first elements.

    Returns:
        How many knots there are.
    """
    knots, before = 0, 0
    for k in range(at.shape[0]):
        here = min(at[k], steps)
        length = here - before
        grid.at[k] = here
        grid.length[k] = length
        grid.velocity[k] = length
        grid.tracking[k] = 0.5 * (length + 1.0)
        if k > 0:
            grid.tracking[k - 1] += 0.5 * (length - 1.0)
        before = here
        knots = k + 1
        if here == steps:
            break
    if grid.at[knots - 1] == at[-1]:
        grid.tracking[knots - 1] *= terminal
    return knots


@expanded
def first_knots(grid, knots):
    """The first knots of a grid."""
    return Grid(grid.at[:knots], grid.length[:knots], grid.tracking[:knots], grid.velocity[:knots])


@inner
def empty_grid(knots):
    """A grid to be filled by :func:`cut`."""
    weights = np.empty((3, knots))
    return Grid(np.empty(knots, np.int64), weights[0], weights[1], weights[2])


@uncounted
def shift_path(old, path, qdot, new, out):
    """The rest of a path one step later, at the knots of a new grid; past its end its last velocity continues.

    Args:
        old: The grid of the path.
        path: Joint coordinates at its knots. Shape (K, n).
        qdot: q̇ Δt of the step that has passed, for a path of a single knot. Shape (n,).
        new: The grid asked for, counted from one step later.
        out: Receives the joint coordinates. Shape (at least as many as there are knots, n).
    """
    last = old.at.shape[0] - 1
    block = 0
    for k in range(new.at.shape[0]):
        time = new.at[k] + 1
        while block < last and old.at[block] < time:
            block += 1
        share = (time - old.at[block]) / old.length[block]  # from the end of the block, so 0 at its knot
        for j in range(path.shape[1]):
            moved = path[block, j] - path[block - 1, j] if block > 0 else qdot[j] * old.length[0]
            out[k, j] = path[block, j] + share * moved


@uncounted
def shift_multipliers(old, multipliers, new):
    """Multipliers one step later, in place: each knot takes over those of the old knot at its time or next after it.

    The new grid is counted from one step later, and has no more knots than the old one.
    """
    last, block = old.at.shape[0] - 1, 0
    for k in range(new.at.shape[0]):
        while block < last and old.at[block] < new.at[k] + 1:
            block += 1
        for i in range(multipliers.shape[1]):
            multipliers[k, i] = multipliers[block, i]
