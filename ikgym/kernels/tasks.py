"""Kernels of the task coordinates: from a pose to its coordinates, their error, and the Jacobians of both.

A frame is a pose as one row of numbers: the 9 of the rotation, row by row, then the 3 of the position in [m]; a
trajectory without orientation has the last 3 only.
"""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels.axes import across, direction_error, direction_error_jacobian
from ikgym.kernels.jit import inlined, inner, kernel
from ikgym.kernels.kinematics import forward
from ikgym.kernels.rotations import quaternion_of, vector_factor

POSITION, SKEW, MATRIX, POSE, AXIS = 0, 1, 2, 3, 4


@kernel
def error_size(kind, m):
    """e, the components of the error, for a kind of task with ``m`` coordinates."""
    if kind == AXIS:
        return 5
    return 6 if kind == POSE else m


@kernel
def coordinates(kind, rotation, position, out):
    """Task coordinates of a pose.

    Args:
        kind: One of POSITION, SKEW, MATRIX, POSE and AXIS.
        rotation: Orientation. Shape (3, 3).
        position: Position in [m]. Shape (3,).
        out: Receives the coordinates. Shape (m,): 3, 6, 12, 12 or 6.
    """
    m = out.shape[0]
    if kind == SKEW:
        # Skew part O^A = ½ (O - Oᵀ), elements 12, 13 and 23 (Varga 2021, eq. 7 and after eq. 8).
        out[0] = 0.5 * (rotation[0, 1] - rotation[1, 0])
        out[1] = 0.5 * (rotation[0, 2] - rotation[2, 0])
        out[2] = 0.5 * (rotation[1, 2] - rotation[2, 1])
    elif kind == AXIS:
        for i in range(3):
            out[i] = rotation[i, 2]
    elif kind != POSITION:
        for i in range(3):
            for j in range(3):
                out[3 * i + j] = rotation[i, j]
    for i in range(3):
        out[m - 3 + i] = position[i]


@inner
def frame_coordinates(kind, frame, out):
    """:func:`coordinates` of a frame of shape (12,), or (3,) where there is no orientation."""
    m, width = out.shape[0], frame.shape[0]
    if kind == SKEW:
        out[0] = 0.5 * (frame[1] - frame[3])
        out[1] = 0.5 * (frame[2] - frame[6])
        out[2] = 0.5 * (frame[5] - frame[7])
    elif kind == AXIS:
        for i in range(3):
            out[i] = frame[3 * i + 2]
    elif kind != POSITION:
        for i in range(9):
            out[i] = frame[i]
    for i in range(3):
        out[m - 3 + i] = frame[width - 3 + i]


@kernel
def error(kind, nominal, coordinates, out):
    """The error of task coordinates.

    Args:
        kind: One of POSITION, SKEW, MATRIX, POSE and AXIS.
        nominal: Nominal coordinates. Shape (m,).
        coordinates: Coordinates. Shape (m,).
        out: Receives the error. Shape (e,): the difference of the coordinates; for POSE the position
            error in [m], then the rotation vector of R* Rᵀ in [rad] (Zhang 2020, eq. 51-54), and for AXIS the
            position error, then that of the direction, see :func:`ikgym.kernels.axes.direction_error`.
    """
    if kind == POSE:
        for i in range(3):
            out[i] = nominal[9 + i] - coordinates[9 + i]
        # The quaternion of R* Rᵀ, without the matrix itself, which would have to be allocated.
        w, x, y, z = quaternion_of(
            (_rows(nominal, 0, coordinates, 0), _rows(nominal, 0, coordinates, 3), _rows(nominal, 0, coordinates, 6)),
            (_rows(nominal, 3, coordinates, 0), _rows(nominal, 3, coordinates, 3), _rows(nominal, 3, coordinates, 6)),
            (_rows(nominal, 6, coordinates, 0), _rows(nominal, 6, coordinates, 3), _rows(nominal, 6, coordinates, 6)),
        )
        factor = vector_factor(w, x, y, z)
        out[3] = factor * x
        out[4] = factor * y
        out[5] = factor * z
    elif kind == AXIS:
        for i in range(3):
            out[i] = nominal[3 + i] - coordinates[3 + i]
        out[3], out[4] = direction_error(nominal, coordinates)
    else:
        for i in range(out.shape[0]):
            out[i] = nominal[i] - coordinates[i]


@inlined
def _rows(a, i, b, j):
    """The product of a row of one rotation and a row of another, where they begin in their frames."""
    return a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2]


@kernel
def jacobian(kind, rotation, geometric, out):
    """Derivative of the task coordinates; for POSE and AXIS that of -error where the error is 0.

    Args:
        kind: One of POSITION, SKEW, MATRIX, POSE and AXIS.
        rotation: Orientation. Shape (3, 3).
        geometric: Geometric Jacobian, linear rows first. Shape (6, n).
        out: Receives the task Jacobian. Shape (e, n).
    """
    n, e = geometric.shape[1], out.shape[0]
    if kind == POSE:
        for i in range(6):
            for j in range(n):
                out[i, j] = geometric[i, j]
        return
    if kind == AXIS:
        ax, ay, az, bx, by, bz = across(rotation[0, 2], rotation[1, 2], rotation[2, 2])
        for j in range(n):
            wx, wy, wz = geometric[3, j], geometric[4, j], geometric[5, j]
            for i in range(3):
                out[i, j] = geometric[i, j]
            out[3, j] = ax * wx + ay * wy + az * wz
            out[4, j] = bx * wx + by * wy + bz * wz
        return
    for j in range(n):
        wx, wy, wz = geometric[3, j], geometric[4, j], geometric[5, j]
        if kind == SKEW:
            # axial(O^A)' = ½ (tr(O) I - O) ω, and O^A_12 = -a_3, O^A_13 = a_2, O^A_23 = -a_1.
            trace = rotation[0, 0] + rotation[1, 1] + rotation[2, 2]
            a1 = 0.5 * (trace * wx - rotation[0, 0] * wx - rotation[0, 1] * wy - rotation[0, 2] * wz)
            a2 = 0.5 * (trace * wy - rotation[1, 0] * wx - rotation[1, 1] * wy - rotation[1, 2] * wz)
            a3 = 0.5 * (trace * wz - rotation[2, 0] * wx - rotation[2, 1] * wy - rotation[2, 2] * wz)
            out[0, j] = -a3
            out[1, j] = a2
            out[2, j] = -a1
        elif kind == MATRIX:
            # O' = ω × O, column by column.
            for k in range(3):
                x, y, z = rotation[0, k], rotation[1, k], rotation[2, k]
                out[k, j] = wy * z - wz * y
                out[3 + k, j] = wz * x - wx * z
                out[6 + k, j] = wx * y - wy * x
        for i in range(3):
            out[e - 3 + i, j] = geometric[i, j]


@inner
def coordinate_jacobian(kind, rotation, geometric, out):
    """Derivative of the task coordinates themselves. ``out`` (m, n); else as :func:`jacobian`."""
    if kind == AXIS:
        x, y, z = rotation[0, 2], rotation[1, 2], rotation[2, 2]
        for j in range(geometric.shape[1]):
            wx, wy, wz = geometric[3, j], geometric[4, j], geometric[5, j]
            out[0, j] = wy * z - wz * y
            out[1, j] = wz * x - wx * z
            out[2, j] = wx * y - wy * x
            for i in range(3):
                out[3 + i, j] = geometric[i, j]
    else:
        # The coordinates of POSE are those of MATRIX.
        jacobian(MATRIX if kind == POSE else kind, rotation, geometric, out)


@kernel
def error_jacobian(kind, nominal, coordinates, error, jacobian, out):
    """Derivative of the error by the joint coordinates, exact for errors of any size.

    Args:
        kind: One of POSITION, SKEW, MATRIX, POSE and AXIS.
        nominal: Nominal coordinates. Shape (m,).
        coordinates: Coordinates. Shape (m,).
        error: The error between them. Shape (e,).
        jacobian: Result of :func:`jacobian`. Shape (e, n).
        out: Receives ∂error/∂q. Shape (e, n).
    """
    e, n = jacobian.shape
    if kind == POSE:
        # R* Rᵀ moves by exp(-ω dt) from the right: φ' = -J_r⁻¹(φ) ω.
        x, y, z = error[3], error[4], error[5]
        square = x * x + y * y + z * z
        angle = math.sqrt(square)
        if angle < 1e-4:
            c = 1.0 / 12.0 + square / 720.0
        else:
            half = 0.5 * angle
            c = (1.0 - half * math.cos(half) / math.sin(half)) / square
        for j in range(n):
            for i in range(3):
                out[i, j] = -jacobian[i, j]
            wx, wy, wz = jacobian[3, j], jacobian[4, j], jacobian[5, j]
            ux, uy, uz = y * wz - z * wy, z * wx - x * wz, x * wy - y * wx
            vx, vy, vz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
            out[3, j] = -(wx + 0.5 * ux + c * vx)
            out[4, j] = -(wy + 0.5 * uy + c * vy)
            out[5, j] = -(wz + 0.5 * uz + c * vz)
    elif kind == AXIS:
        for j in range(n):
            for i in range(3):
                out[i, j] = -jacobian[i, j]
        direction_error_jacobian(nominal, coordinates, jacobian[3:], out[3:])
    else:
        for i in range(e):
            for j in range(n):
                out[i, j] = -jacobian[i, j]


@kernel
def pose_rows(chain, kind, q, out):
    """Task coordinates of a chain, row by row.

    Args:
        chain: The arm, see :class:`ikgym.kernels.kinematics.Chain`.
        kind: Of task coordinates.
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        out: Receives the task coordinates. Shape (B, m).
    """
    rotation, position = np.empty((3, 3)), np.empty(3)
    for row in range(q.shape[0]):
        forward(chain, q[row], rotation, position)
        coordinates(kind, rotation, position, out[row])
