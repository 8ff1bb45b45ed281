"""Kernels: joint motions, random control points of splines, and the nominal frames along motions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.jit import inlined, kernel, uncounted
from ikgym.kernels.kinematics import forward

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

# Moves of less than this share of the largest count as none, so that nothing is divided by 0.
TINY = 1e-12


class Motions(NamedTuple):
    """Motions of N episodes, and the points of them that a step needs.

    Attributes:
        control: The rows' motions, see :func:`motion_rows`. Shape (N, c, n).
        duration: See there.
        dt: Δt in [s].
        first: Number of the first point of the rows' episodes, all points of all their episodes being counted on.
            Shape (N,).
        point: Number of the target after k steps, from the first one of an episode. Shape (steps + furthest
            preview + 1,).
        preview: How many steps ahead the nominal coordinates are shown. Shape (p,).
        known: Numbers of the points whose frames are in the tables, changed in place. Shape (N, slots).
    """

    control: Floats
    duration: float
    dt: float
    first: Integers
    point: Integers
    preview: Integers
    known: Integers


@inlined
def _spline(control, time, duration, out):
    """A uniform cubic B-spline, constant beyond its ends.

    Args:
        control: Control points in [rad] or [m]. Shape (c, n).
        time: In [s].
        duration: In [s].
        out: Receives the joint coordinates in [rad] or [m]. Shape (n,).
    """
    spans = control.shape[0] - 3
    at = min(max(time / duration, 0.0), 1.0) * spans
    i = min(int(at), spans - 1)
    u = at - i
    rest = 1.0 - u
    for j in range(out.shape[0]):
        inner = (4.0 + u * u * (3.0 * u - 6.0)) * control[i + 1, j]
        inner += (4.0 + rest * rest * (3.0 * rest - 6.0)) * control[i + 2, j]
        out[j] = (rest * rest * rest * control[i, j] + inner + u * u * u * control[i + 3, j]) / 6.0


@inlined
def _at(motion, time, duration, out):
    """A motion at one time: a spline, or where the duration is 0 a sinusoid; see :func:`motion_rows`."""
    if duration > 0.0:
        _spline(motion, time, duration, out)
    else:
        for j in range(out.shape[0]):
            out[j] = motion[0, j] * math.sin(time * motion[1, j] + motion[2, j]) + motion[3, j]


@kernel
def motion_rows(motions, times, duration, out):
    """Several motions, each at different times.

    Args:
        motions: Control points of splines; or amplitudes, frequencies, phases and offsets of sinusoids. (k, c, n).
        times: In [s]. Shape (k, t).
        duration: Of the splines, in [s]; 0 for sinusoids.
        out: Receives the joint coordinates in [rad] or [m]. Shape (k, t, n).
    """
    for row in range(times.shape[0]):
        for i in range(times.shape[1]):
            _at(motions[row], times[row, i], duration, out[row, i])


@kernel
def control_rows(drawn, lower, upper, fastest, hardest, low, high, out):
    """Control points of random motions within limits, see :class:`ikgym.trajectories.RandomJointSpline`.

    Args:
        drawn: Numbers that are uniform in (0, 1): of starts, of shares, and of spans − 2 moves. Shape (k, spans, n).
        lower: Lowest control points in [rad] or [m]. Shape (n,).
        upper: Highest control points. Shape (n,).
        fastest: Largest differences of control points. Shape (n,).
        hardest: Largest second differences. Shape (n,).
        low: The smallest share of the motion within the limits.
        high: The largest one.
        out: Receives the control points. Shape (k, spans + 3, n).
    """
    spans = drawn.shape[1]
    for row in range(drawn.shape[0]):
        for j in range(drawn.shape[2]):
            first, moves, control = (
                lower[j] + drawn[row, 0, j] * (upper[j] - lower[j]),
                drawn[row, :, j],
                out[row, :, j],
            )
            up = down = steepest = sharpest = before = 0.0
            control[0] = 0.0
            for i in range(spans + 2):
                # The first two moves and the last two are none: rest, with no acceleration, at both ends.
                move = 2.0 * moves[i] - 1.0 if 2 <= i < spans else 0.0
                control[i + 1] = control[i] + move
                up, down = max(up, control[i + 1]), max(down, -control[i + 1])
                steepest, sharpest = max(steepest, abs(move)), max(sharpest, abs(move - before))
                before = move
            largest = min(
                (upper[j] - first) / max(up, TINY),
                (first - lower[j]) / max(down, TINY),
                fastest[j] / max(steepest, TINY),
                hardest[j] / max(sharpest, TINY),
            )
            size = (low + drawn[row, 1, j] * (high - low)) * largest
            for i in range(spans + 3):
                control[i] = min(max(first + size * control[i], lower[j]), upper[j])  # rounding


@kernel
def complete(chain, motions, tables, made, active, moving, count, start, stop):
    """Computes the nominal frames that rows need in their next steps and that are not in their tables yet.

    Args:
        chain: Of the model, a :class:`ikgym.kernels.kinematics.Chain`.
        motions: A :class:`Motions`.
        tables: The frames, changed in place. Shape (N, slots, 12 or 3).
        made: Steps made in the episodes. Shape (N,).
        active: The rows that are meant. Shape (N,).
        moving: Whether they are about to move, or are observed where they are.
        count: How many steps.
        start: The first row.
        stop: The row after the last.
    """
    q, frame = np.empty(motions.control.shape[2]), np.empty(12)
    _rows(chain, motions, tables, q, frame, made, active, 1 if moving else 0, count, start, stop)


@uncounted
def _rows(chain, motions, tables, q, frame, made, active, next_step, count, start, stop):
    """The rows of :func:`complete`, with its scratch."""
    point, preview = motions.point, motions.preview
    steps = point.shape[0] - 1 - preview[preview.shape[0] - 1]
    for row in range(start, stop):
        if active[row]:
            k = made[row] + next_step
            for step in range(k, min(k + count, steps + 1)):
                _complete(chain, motions, row, point[step], tables[row], q, frame)
                for i in range(preview.shape[0]):
                    _complete(chain, motions, row, point[step + preview[i]], tables[row], q, frame)


@inlined
def _complete(chain, motions, row, point, table, q, frame):
    """The frame of one point of a row, if its table does not have it."""
    known, rotation, position = motions.known[row], frame[:9].reshape(3, 3), frame[9:]
    slot, number = point % known.shape[0], motions.first[row] + point
    if known[slot] == number:
        return
    known[slot] = number
    _at(motions.control[row], float(point) * motions.dt, motions.duration, q)
    forward(chain, q, rotation, position)
    width = table.shape[1]
    if width == 12:
        for i in range(3):
            for j in range(3):
                table[slot, 3 * i + j] = rotation[i, j]
    for i in range(3):
        table[slot, width - 3 + i] = position[i]
