"""Kernels: an arm whose joint zeros, links and axes differ from those of its model, and how its pose depends on them.

The parameters of an arm with n joints are p = 6 n + 3 numbers: offsets of the joint coordinates (n), to the
offsets from joint to joint and to the tool point (3 n + 3), and how far each axis is tilted in two directions across it
(2 n). As on the plant, see :class:`ikgym.Plant`.
"""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels.axes import across
from ikgym.kernels.jit import inlined, inner
from ikgym.kernels.kinematics import Chain


@inner
def changed_chain(chain, parameters, offsets, axes, tool):
    """The chain with the parameters except the joint zeros; its parts become those arrays of (n, 3), (n, 3), (3,)."""
    n = axes.shape[0]
    for i in range(n):
        ax, ay, az = chain.axes[i, 0], chain.axes[i, 1], chain.axes[i, 2]
        ux, uy, uz, vx, vy, vz = across(ax, ay, az)
        a, b = parameters[4 * n + 3 + 2 * i], parameters[4 * n + 4 + 2 * i]
        # Tilted by a about u and by b about v: u × axis = -v, v × axis = u.
        ax, ay, az = ax + b * ux - a * vx, ay + b * uy - a * vy, az + b * uz - a * vz
        length = math.sqrt(ax * ax + ay * ay + az * az)
        axes[i, 0], axes[i, 1], axes[i, 2] = ax / length, ay / length, az / length
        for k in range(3):
            offsets[i, k] = chain.offsets[i, k] + parameters[n + 3 * i + k]
    for k in range(3):
        tool[k] = chain.tool[k] + parameters[4 * n + k]
    return Chain(offsets, axes, chain.prismatic, tool, chain.tool_rotation)


@inlined
def _axis_turn(rotation, axis, q, after):
    """Turns a frame about one of its axes by an angle: shapes (3, 3), (3,), a number, (3, 3)."""
    s, half = math.sin(q), math.sin(0.5 * q)
    v = 2.0 * half * half
    x, y, z = axis[0], axis[1], axis[2]
    for i in range(3):
        a, b, c = rotation[i, 0], rotation[i, 1], rotation[i, 2]
        along = a * x + b * y + c * z
        # The row times cos + (1 - cos) a aᵀ + sin [a]×.
        after[i, 0] = a + v * (along * x - a) + s * (b * z - c * y)
        after[i, 1] = b + v * (along * y - b) + s * (c * x - a * z)
        after[i, 2] = c + v * (along * z - c) + s * (a * y - b * x)


@inlined
def _put(twist, column, linear, angular):
    for k in range(3):
        twist[k, column], twist[3 + k, column] = linear[k], angular[k]


@inner
def parameter_twists(chain, q, position, twist):
    """Jacobian of the pose by the parameters, in the base frame: 3 rows of the position, 3 of the orientation.

    The axes are taken as those of the chain: exact where the tilts are 0, to the first order else.

    Args:
        chain: The arm with its parameters.
        q: Joint coordinates with the joint zeros, in [rad] or [m]. Shape (n,).
        position: The tool point in [m]. Shape (3,).
        twist: Receives the derivatives. Shape (6, p).
    """
    n = q.shape[0]
    before, after, here = np.eye(3), np.eye(3), np.zeros(3)
    axis, tilt, arm, none = np.empty(3), np.empty(3), np.empty(3), np.zeros(3)
    for i in range(n):
        for k in range(3):
            _put(twist, n + 3 * i + k, before[:, k], none)
            axis[k] = (
                before[k, 0] * chain.axes[i, 0] + before[k, 1] * chain.axes[i, 1] + before[k, 2] * chain.axes[i, 2]
            )
            here[k] += (
                before[k, 0] * chain.offsets[i, 0]
                + before[k, 1] * chain.offsets[i, 1]
                + before[k, 2] * chain.offsets[i, 2]
            )
        u, v = _across_of(chain.axes[i])
        if chain.prismatic[i]:
            _put(twist, i, axis, none)
            for k in range(3):
                here[k] += q[i] * axis[k]
                # The axis moves along -v for a tilt about u, and along u for one about v.
                arm[k] = -q[i] * (before[k, 0] * v[0] + before[k, 1] * v[1] + before[k, 2] * v[2])
                tilt[k] = q[i] * (before[k, 0] * u[0] + before[k, 1] * u[1] + before[k, 2] * u[2])
            _put(twist, 4 * n + 3 + 2 * i, arm, none)
            _put(twist, 4 * n + 4 + 2 * i, tilt, none)
            continue
        _axis_turn(before, chain.axes[i], q[i], after)
        for k in range(3):
            arm[k] = position[k] - here[k]
        _put(twist, i, _cross(axis, arm), axis)
        for j in range(2):
            direction = u if j == 0 else v
            # A tilt turns all links after it before the rotation of the joint, and back after it.
            for k in range(3):
                tilt[k] = 0.0
                for c in range(3):
                    tilt[k] += (before[k, c] - after[k, c]) * direction[c]
            _put(twist, 4 * n + 3 + 2 * i + j, _cross(tilt, arm), tilt)
        before[:] = after
    for k in range(3):
        _put(twist, 4 * n + k, before[:, k], none)


@inlined
def _cross(a, b):
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@inlined
def _across_of(axis):
    ux, uy, uz, vx, vy, vz = across(axis[0], axis[1], axis[2])
    return (ux, uy, uz), (vx, vy, vz)
