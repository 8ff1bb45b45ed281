"""Kernels: the arms, loops and delays that episodes draw."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.jit import inlined, kernel, uncounted
from ikgym.kernels.random_numbers import normal, share, stream

Floats = npt.NDArray[np.float64]

# The streams of an arm's key, and where those of the noises begin, which may have the same one.
ZERO, LINK, AXIS, WHICH, BANDWIDTH, DELAY = range(6)
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


class Arms(NamedTuple):
    """N drawn arms, as :class:`ikgym.kernels.kinematics.Chain` has them: each without its payload, then with it.

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
def draw_arms(spread, keys, rows, arms):
    """Draws the arms of some rows.

    Args:
        spread: A :class:`Spread`.
        keys: One a row that is drawn. Shape (k,).
        rows: Which rows they are. Shape (k,).
        arms: An :class:`Arms`, which receives them.
    """
    payload = np.any(spread.payload)
    for i in range(keys.shape[0]):
        _draw_arm(spread, keys[i], rows[i], 0, arms)
        if payload:
            _draw_arm(spread, keys[i], rows[i], 1, arms)
        else:
            _copy_arm(rows[i], arms)


@uncounted
def _draw_arm(spread, key, row, loaded, arms):
    """The arm of a row, without its payload or with it."""
    offsets, axes = arms.offsets[row, loaded], arms.axes[row, loaded]
    tool, tool_rotation = arms.tool[row, loaded], arms.tool_rotation[row, loaded]
    n, of_links, of_axes, of_zeros = spread.prismatic.shape[0], stream(key, LINK), stream(key, AXIS), stream(key, ZERO)
    which = int(share(stream(key, WHICH), np.uint64(0)) * spread.offsets.shape[0])
    for j in range(n):
        _shift(of_links, j, spread.link, spread.offsets[which, j], offsets[j])
        _tilt(of_axes, j, spread.axis, spread.axes[which, j], axes[j])
    _shift(of_links, n, spread.link, spread.tool[which], tool)
    _copy(spread.tool_rotation[which], tool_rotation)
    for j in range(n):
        zero = 0.0
        if spread.zero[j] != 0.0:
            zero = spread.zero[j] * normal(of_zeros, np.uint64(j))
        if loaded == 1:
            zero += spread.payload[j]
        if zero != 0.0:
            _begin_at(j, zero, spread.prismatic, offsets, axes, tool, tool_rotation)


@inlined
def _copy_arm(row, arms):
    """The arm of a row with a payload, where there is none."""
    _copy(arms.offsets[row, 0], arms.offsets[row, 1])
    _copy(arms.axes[row, 0], arms.axes[row, 1])
    _copy(arms.tool[row, :1], arms.tool[row, 1:])
    _copy(arms.tool_rotation[row, 0], arms.tool_rotation[row, 1])


@inlined
def _copy(vectors, out):
    for i in range(out.shape[0]):
        for c in range(3):
            out[i, c] = vectors[i, c]


@kernel
def draw_loops(bandwidth, delay, keys, drawn_bandwidth, drawn_delay):
    """Draws velocity loops and delays of commands.

    Args:
        bandwidth: Lowest and highest bandwidth in [Hz]. Shape (2,).
        delay: Lowest and highest delay in steps. Shape (2,).
        keys: One a row that is drawn. Shape (k,).
        drawn_bandwidth: Receives the bandwidths in [Hz]. Shape (k,).
        drawn_delay: Receives the delays in steps. Shape (k,).
    """
    for i in range(keys.shape[0]):
        drawn_bandwidth[i] = bandwidth[0]
        if bandwidth[0] < bandwidth[1]:
            drawn_bandwidth[i] += (bandwidth[1] - bandwidth[0]) * share(stream(keys[i], BANDWIDTH), np.uint64(0))
        drawn_delay[i] = delay[0] + int((delay[1] - delay[0] + 1) * share(stream(keys[i], DELAY), np.uint64(0)))


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
def _shift(key, number, deviation, vector, out):
    """A vector with a normal part, in each of its three parts."""
    for c in range(3):
        out[c] = vector[c]
        if deviation != 0.0:
            out[c] += deviation * normal(key, np.uint64(3 * number + c))


@inlined
def _tilt(key, number, deviation, axis, out):
    """A unit vector that is tilted by a normal vector, of which what lies along it does nothing."""
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

    Rot(a, q + z) = Rot(a, q) Rot(a, z): what follows the joint is turned by its zero, and all link frames are parallel
    to the base at q = 0 again.
    """
    axis = axes[j, 0], axes[j, 1], axes[j, 2]
    if prismatic[j]:
        for c in range(3):
            offsets[j, c] += zero * axis[c]
        return
    s, half = math.sin(zero), math.sin(0.5 * zero)
    v = 2.0 * half * half
    for i in range(j + 1, offsets.shape[0]):
        _turn(axis, s, v, offsets[i])
        _turn(axis, s, v, axes[i])
        _to_unit(axes[i])
    _turn(axis, s, v, tool)
    for c in range(3):
        _turn(axis, s, v, tool_rotation[:, c])


@inlined
def _turn(axis, s, v, vector):
    """Turns a vector in place, by Rodrigues' formula with the sine and 1 − the cosine of the angle."""
    x, y, z = vector[0], vector[1], vector[2]
    ax, ay, az = axis
    cx, cy, cz = ay * z - az * y, az * x - ax * z, ax * y - ay * x
    vector[0] = x + s * cx + v * (ay * cz - az * cy)
    vector[1] = y + s * cy + v * (az * cx - ax * cz)
    vector[2] = z + s * cz + v * (ax * cy - ay * cx)
