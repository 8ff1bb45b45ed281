"""Kernels: forward kinematics and geometric Jacobian of a serial chain, in one pass.

The chain is ``H = H_1 … H_n · H_tool`` with ``H_i = Trans(offset_i) · Rot(axis_i, q_i)``, or
``Trans(offset_i + q_i · axis_i)`` for a prismatic joint (Varga 2021, eq. 6; Khan 2020, eq. 3.12 and 4.18). All
link frames are parallel to the base at q = 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.jit import inlined, kernel


class Chain(NamedTuple):
    """An arm as its kernels see it.

    Attributes:
        offsets: From the frame of the joint before to the joint, in [m]. Shape (n, 3).
        axes: Unit vectors in the frames of the joints. Shape (n, 3).
        prismatic: True where a joint is prismatic. Shape (n,).
        tool: Tool point in the last frame, in [m]. Shape (3,).
        tool_rotation: Orientation of the tool in the last frame. Shape (3, 3).
    """

    offsets: npt.NDArray[np.float64]
    axes: npt.NDArray[np.float64]
    prismatic: npt.NDArray[np.bool_]
    tool: npt.NDArray[np.float64]
    tool_rotation: npt.NDArray[np.float64]


def add_arm_axis(chain: Chain) -> Chain:
    """An arm with a leading axis of 1 for arms, one for all poses; ``prismatic`` has none."""
    offsets, axes, prismatic, tool, tool_rotation = chain
    return Chain(offsets[None], axes[None], prismatic, tool[None], tool_rotation[None])


@kernel
def forward(chain, q, rotation, position):
    """Forward kinematics of one configuration.

    Args:
        chain: The arm, a :class:`Chain`.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        rotation: Receives the orientation of the tool. Shape (3, 3).
        position: Receives the tool point in the base frame in [m]. Shape (3,).
    """
    _walk(chain, q, rotation, position, rotation, False)


@kernel
def forward_and_jacobian(chain, q, rotation, position, jacobian):
    """Forward kinematics and geometric Jacobian of one configuration.

    Args:
        chain: The arm, a :class:`Chain`.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        rotation: Receives the orientation of the tool. Shape (3, 3).
        position: Receives the tool point in the base frame in [m]. Shape (3,).
        jacobian: Receives the Jacobian at the tool point, in the base frame: rows 0-2 linear in [m/s], rows 3-5
            angular in [rad/s], per unit of joint velocity. Shape (6, n).
    """
    _walk(chain, q, rotation, position, jacobian, True)
    for i in range(q.shape[0]):
        if chain.prismatic[i]:
            continue
        # The walk left the point of the joint in the linear rows: v = axis × (tool - joint).
        x = position[0] - jacobian[0, i]
        y = position[1] - jacobian[1, i]
        z = position[2] - jacobian[2, i]
        wx, wy, wz = jacobian[3, i], jacobian[4, i], jacobian[5, i]
        jacobian[0, i] = wy * z - wz * y
        jacobian[1, i] = wz * x - wx * z
        jacobian[2, i] = wx * y - wy * x


@inlined
def _walk(chain, q, rotation, position, jacobian, keep):
    """Forward pass along the chain; ``keep`` stores the axis and the point of each joint in ``jacobian``."""
    offsets, axes, prismatic = chain.offsets, chain.axes, chain.prismatic
    # The orientation so far is kept in nine scalars, which stay in registers; an array would not.
    r00, r01, r02 = 1.0, 0.0, 0.0
    r10, r11, r12 = 0.0, 1.0, 0.0
    r20, r21, r22 = 0.0, 0.0, 1.0
    px, py, pz = 0.0, 0.0, 0.0
    for i in range(q.shape[0]):
        ox, oy, oz = offsets[i, 0], offsets[i, 1], offsets[i, 2]
        ax, ay, az = axes[i, 0], axes[i, 1], axes[i, 2]
        if prismatic[i]:
            ox += q[i] * ax
            oy += q[i] * ay
            oz += q[i] * az
        px += r00 * ox + r01 * oy + r02 * oz
        py += r10 * ox + r11 * oy + r12 * oz
        pz += r20 * ox + r21 * oy + r22 * oz
        if keep:
            wx = r00 * ax + r01 * ay + r02 * az
            wy = r10 * ax + r11 * ay + r12 * az
            wz = r20 * ax + r21 * ay + r22 * az
            if prismatic[i]:
                jacobian[0, i], jacobian[1, i], jacobian[2, i] = wx, wy, wz
                jacobian[3, i], jacobian[4, i], jacobian[5, i] = 0.0, 0.0, 0.0
            else:
                jacobian[0, i], jacobian[1, i], jacobian[2, i] = px, py, pz
                jacobian[3, i], jacobian[4, i], jacobian[5, i] = wx, wy, wz
        if prismatic[i]:
            continue
        # Rodrigues' formula (Varga 2021, eq. 8), multiplied from the right.
        s = math.sin(q[i])
        half = math.sin(0.5 * q[i])
        v = 2.0 * half * half
        a00, a01, a02 = 1.0 - v * (ay * ay + az * az), v * ax * ay - s * az, v * ax * az + s * ay
        a10, a11, a12 = v * ax * ay + s * az, 1.0 - v * (ax * ax + az * az), v * ay * az - s * ax
        a20, a21, a22 = v * ax * az - s * ay, v * ay * az + s * ax, 1.0 - v * (ax * ax + ay * ay)
        r00, r01, r02 = (
            r00 * a00 + r01 * a10 + r02 * a20,
            r00 * a01 + r01 * a11 + r02 * a21,
            r00 * a02 + r01 * a12 + r02 * a22,
        )
        r10, r11, r12 = (
            r10 * a00 + r11 * a10 + r12 * a20,
            r10 * a01 + r11 * a11 + r12 * a21,
            r10 * a02 + r11 * a12 + r12 * a22,
        )
        r20, r21, r22 = (
            r20 * a00 + r21 * a10 + r22 * a20,
            r20 * a01 + r21 * a11 + r22 * a21,
            r20 * a02 + r21 * a12 + r22 * a22,
        )
    tx, ty, tz = chain.tool[0], chain.tool[1], chain.tool[2]
    position[0] = px + r00 * tx + r01 * ty + r02 * tz
    position[1] = py + r10 * tx + r11 * ty + r12 * tz
    position[2] = pz + r20 * tx + r21 * ty + r22 * tz
    tool_rotation = chain.tool_rotation
    for j in range(3):
        tx, ty, tz = tool_rotation[0, j], tool_rotation[1, j], tool_rotation[2, j]
        rotation[0, j] = r00 * tx + r01 * ty + r02 * tz
        rotation[1, j] = r10 * tx + r11 * ty + r12 * tz
        rotation[2, j] = r20 * tx + r21 * ty + r22 * tz


@kernel
def forward_rows(chain, q, rotation, position):
    """:func:`forward` for N rows: ``q`` (N, n), ``rotation`` (N, 3, 3), ``position`` (N, 3)."""
    for row in range(q.shape[0]):
        forward(chain, q[row], rotation[row], position[row])


@kernel
def forward_and_jacobian_rows(chain, q, rotation, position, jacobian):
    """:func:`forward_and_jacobian` for N rows: as above, with ``jacobian`` (N, 6, n)."""
    for row in range(q.shape[0]):
        forward_and_jacobian(chain, q[row], rotation[row], position[row], jacobian[row])
