"""Kernels: the reference that a policy has seen and not yet passed, and where it is between two samples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels import tasks
from ikgym.kernels.jit import inner
from ikgym.validation import FloatArray


class PathMemory(NamedTuple):
    """Memory of path following.

    Attributes:
        samples: Task coordinates of the reference; sample k is at k modulo L. Shape (B, L, m).
        steps: Steps made. Shape (B,).
        progress: How far along the reference, in steps of it. Shape (B,).
        speed: Progress in the last step. Shape (B,).
    """

    samples: FloatArray
    steps: npt.NDArray[np.int64]
    progress: FloatArray
    speed: FloatArray


@inner
def remember(samples, steps, nominal):
    """Stores samples ``steps`` + 1, … of the reference in the ring; sample 0, which is not shown, is sample 1."""
    for a in range(samples.shape[1]):
        if steps == 0:
            samples[0, a] = nominal[0, a]
        for i in range(nominal.shape[0]):
            samples[(steps + 1 + i) % samples.shape[0], a] = nominal[i, a]


@inner
def moves_around(kind, samples, first, moves):
    """Motions of the reference from sample to sample, from the one before a sample to the third behind it.

    Args:
        kind: The kind of task coordinates.
        samples: Shape (L, m).
        first: Number of the sample.
        moves: Receives the motions. Shape (4, e).
    """
    length = samples.shape[0]
    for i in range(4):
        there = max(first + i, 1)
        tasks.error(kind, samples[there % length], samples[(there - 1) % length], moves[i])


@inner
def slope(moves, part, steps, out):
    """Mean motion of the reference in one step, from a part of a step on: ``steps`` at most 1, ``out`` (e,)."""
    passed = np.empty(out.shape[0])
    interpolate_motion(moves, part, passed)
    interpolate_motion(moves, part + steps, out)
    for a in range(out.shape[0]):
        out[a] = (out[a] - passed[a]) / steps


@inner
def interpolate_motion(moves, part, out):
    """Motion of the reference from a sample on, by a cubic spline with the mean motion as slope (Catmull and Rom 1974).

    Args:
        moves: See :func:`moves_around`. Shape (4, e).
        part: By how many steps, from 0 to 2.
        out: Receives the motion. Shape (e,).
    """
    whole = 1 if part > 1.0 else 0
    t = part - whole
    for a in range(out.shape[0]):
        before, move, behind = moves[whole, a], moves[whole + 1, a], moves[whole + 2, a]
        out[a] = move * t * t * (3.0 - 2.0 * t) + whole * moves[1, a]
        out[a] += 0.5 * (before + move) * t * (1.0 - t) * (1.0 - t) - 0.5 * (move + behind) * t * t * (1.0 - t)
