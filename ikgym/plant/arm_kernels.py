"""Kernels: the arms, loops and delays that episodes draw."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.jit import inlined, kernel, uncounted
from ikgym.kernels.random_numbers import normal, share, stream

Floats = npt.NDArray[np.float64]

# The streams of an arm's key, those of its ranges, and where those of the noises begin, which may have the same one.
ZERO, LINK, AXIS, WHICH = range(4)
RANGE_STREAMS = (4, 5, 20, 21, 22, 23, 24)
ARM_STREAMS = 6


class Spread(NamedTuple):
    """Distribution of arms.

    Attributes:
        offsets: Of the arms one of which is taken, in [m]. Shape (a, n, 3).
        axes: Their axes. Shape (a, n, 3).
        prismatic: True where a joint is prismatic. Shape (n,).
        tool: Their tool points in [m]. Shape (a, 3).
        tool_rotation: Their tools' orientations. Shape (a, 3, 3).
        zero: Standard deviation of the joints' zeros in [rad] or [m]. Shape (n,).
        payload: Offset of the zeros by a payload in [rad] or [m]. Shape (n,).
        link: Standard deviation of each part of an offset and of the tool point, in [m].
        axis: Standard deviation of the tilt of an axis in each of two directions, in [rad].
    """

    offsets: Floats
    axes: Floats
    prismatic: npt.NDArray[np.bool_]
    tool: Floats
    tool_rotation: Floats
    zero: Floats
    payload: Floats
    link: float
    axis: float


class Numbers(NamedTuple):
    """Numbers that episodes draw from ranges, by the names of :class:`ikgym.Plant`. Shapes (k,)."""

    bandwidth: Floats
    command_delay: Floats
    calibration: Floats
    load: Floats
    pose_noise: Floats
    pose_rotation_noise: Floats
    pose_every: Floats


class Ranges(NamedTuple):
    """Ranges that :class:`Numbers` are drawn from.

    Attributes:
        low: Their lower ends. Shape (r,).
        high: Their upper ends. Shape (r,).
        whole: Where whole numbers are drawn, both ends included. Shape (r,).
        streams: The streams of an arm's key. Shape (r,).
        near: How far from the middle numbers are drawn at least, as a share of half the range.
        far: The same, at most.
    """

    low: Floats
    high: Floats
    whole: npt.NDArray[np.bool_]
    streams: npt.NDArray[np.uint64]
    near: float
    far: float


class Arms(NamedTuple):
    """N drawn arms, as :class:`ikgym.kernels.kinematics.Chain` has them: each without its payload, then with it.

    One arm, so that caches hold it, where all rows have the same.

    Attributes:
        offsets: Shape (N, 2, n, 3).
        axes: Shape (N, 2, n, 3).
        tool: Shape (N, 2, 3).
        tool_rotation: Shape (N, 2, 3, 3).
    """

    offsets: Floats
    axes: Floats
    tool: Floats
    tool_rotation: Floats


@kernel
def draw_arms(spread, keys, rows, calibration, load, arms):
    """Draws the arms of some rows.

    Args:
        spread: A :class:`Spread`.
        keys: One a row that is drawn. Shape (k,).
        rows: Which rows they are. Shape (k,).
        calibration: Factors of zeros, links and tilts. Shape (k,).
        load: Factors of the payload. Shape (k,).
        arms: An :class:`Arms`, which receives them.
    """
    for i in range(keys.shape[0]):
        for loaded in range(2):
            _draw_arm(spread, keys[i], rows[i], loaded, calibration[i], load[i], arms)


@uncounted
def _draw_arm(spread, key, row, loaded, calibration, load, arms):
    """The arm of a row, without its payload or with it, by the factors of the row."""
    offsets, axes = arms.offsets[row, loaded], arms.axes[row, loaded]
    tool, tool_rotation = arms.tool[row, loaded], arms.tool_rotation[row, loaded]
    n, of_links, of_axes, of_zeros = spread.prismatic.shape[0], stream(key, LINK), stream(key, AXIS), stream(key, ZERO)
    which = int(share(stream(key, WHICH), np.uint64(0)) * spread.offsets.shape[0])
    for j in range(n):
        _shift(of_links, j, calibration * spread.link, spread.offsets[which, j], offsets[j])
        _tilt(of_axes, j, calibration * spread.axis, spread.axes[which, j], axes[j])
    _shift(of_links, n, calibration * spread.link, spread.tool[which], tool)
    _copy(spread.tool_rotation[which], tool_rotation)
    for j in range(n):
        zero = zero_of(spread, of_zeros, j, loaded, calibration, load)
        if zero != 0.0:
            _begin_at(j, zero, spread.prismatic, offsets, axes, tool, tool_rotation)


@inlined
def zero_of(spread, of_zeros, j, loaded, calibration, load):
    """The zero of a joint, with the payload or without it."""
    zero = 0.0
    if spread.zero[j] != 0.0:
        zero = calibration * spread.zero[j] * normal(of_zeros, np.uint64(j))
    return zero + load * spread.payload[j] if loaded == 1 else zero


@inlined
def _copy(vectors, out):
    for i in range(out.shape[0]):
        for c in range(3):
            out[i, c] = vectors[i, c]


@kernel
def draw_ranges(ranges, keys, out, context):
    """Draws numbers from ranges.

    Args:
        ranges: A :class:`Ranges`.
        keys: One a row that is drawn. Shape (k,).
        out: Receives the numbers. Shape (r, k).
        context: Receives those of ranges with two ends, from -1 at the lower to 1 at the upper one. Shape (k, c).
    """
    for i in range(keys.shape[0]):
        column = 0
        for number in range(ranges.low.shape[0]):
            out[number, i] = low = ranges.low[number]
            width = ranges.high[number] - low
            if low < ranges.high[number]:
                away = _away(share(stream(keys[i], ranges.streams[number]), np.uint64(0)), ranges.near, ranges.far)
                drawn = min(math.floor((width + 1.0) * away), width) if ranges.whole[number] else width * away
                out[number, i] += drawn
                context[i, column] = 2.0 * drawn / width - 1.0
                column += 1


@kernel
def stream_rows(keys, rows, out):
    """The keys of the noises of some rows: the first is that of the episode.

    Args:
        keys: One a row. Shape (k,).
        rows: Which rows they are. Shape (k,).
        out: Receives the keys. Shape (N, streams).
    """
    for i in range(keys.shape[0]):
        out[rows[i], 0] = keys[i]
        for number in range(1, out.shape[1]):
            out[rows[i], number] = stream(keys[i], np.uint64(ARM_STREAMS + number))


@inlined
def _away(place, near, far):
    """A place on (0, 1), moved so far from the middle that it is between two shares of the way to the ends."""
    if near == 0.0 and far == 1.0:
        return place
    off = 2.0 * place - 1.0
    return 0.5 + 0.5 * math.copysign(near + (far - near) * abs(off), off)


@inlined
def _shift(key, number, deviation, vector, out):
    """A vector with a normal part, in each of its three parts."""
    for c in range(3):
        out[c] = vector[c]
        if deviation != 0.0:
            out[c] += deviation * normal(key, np.uint64(3 * number + c))


@inlined
def _tilt(key, number, deviation, axis, out):
    """A unit vector that is tilted by the part of a normal vector across it."""
    if deviation == 0.0:
        for c in range(3):
            out[c] = axis[c]
        return
    along = 0.0
    for c in range(3):
        out[c] = deviation * normal(key, np.uint64(3 * number + c))
        along += out[c] * axis[c]
    for c in range(3):
        out[c] += (1.0 - along) * axis[c]
    _to_unit(out)


@inlined
def _to_unit(vector):
    length = math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
    for c in range(3):
        vector[c] /= length


@inlined
def _begin_at(j, zero, prismatic, offsets, axes, tool, tool_rotation):
    """Makes a chain have a joint's coordinate ``zero`` where the joint's encoder says 0.

    Rot(a, q + z) = Rot(a, q) Rot(a, z): all links after the joint are turned by its zero, and all link frames are
    parallel to the base at q = 0 again.
    """
    axis = axes[j, 0], axes[j, 1], axes[j, 2]
    if prismatic[j]:
        for c in range(3):
            offsets[j, c] += zero * axis[c]
        return
    s, half = math.sin(zero), math.sin(0.5 * zero)
    v = 2.0 * half * half
    for i in range(j + 1, offsets.shape[0]):
        turn(axis, s, v, offsets[i])
        turn(axis, s, v, axes[i])
        _to_unit(axes[i])
    turn(axis, s, v, tool)
    for c in range(3):
        turn(axis, s, v, tool_rotation[:, c])


@inlined
def turn(axis, s, v, vector):
    """Turns a vector in place, by Rodrigues' formula with the sine and 1 − the cosine of the angle."""
    x, y, z = vector[0], vector[1], vector[2]
    ax, ay, az = axis
    cx, cy, cz = ay * z - az * y, az * x - ax * z, ax * y - ay * x
    vector[0] = x + s * cx + v * (ay * cz - az * cy)
    vector[1] = y + s * cy + v * (az * cx - ax * cz)
    vector[2] = z + s * cz + v * (ax * cy - ay * cx)
