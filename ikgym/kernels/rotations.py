"""Kernels on rotation matrices: Rodrigues' formula, the rotation vector and the geodesic angle.

All of them are compiled, take float64 arrays and raise nothing. A rotation is a (3, 3) orthogonal matrix with
determinant 1, an axis a unit vector of shape (3,).
"""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels.jit import inlined, inner, kernel


@kernel
def rodrigues(axis, angle):
    """The rotation about a unit axis (Varga 2021, eq. 8; Khan 2020, eq. 4.17).

    Args:
        axis: Unit vector. Shape (3,).
        angle: Angle in [rad].

    Returns:
        The rotation matrix. Shape (3, 3).
    """
    out = np.empty((3, 3))
    x, y, z = axis[0], axis[1], axis[2]
    s = math.sin(angle)
    # 1 - cos loses all digits near 0; 2 sin² of the half does not.
    half = math.sin(0.5 * angle)
    v = 2.0 * half * half
    out[0, 0] = 1.0 - v * (y * y + z * z)
    out[0, 1] = v * x * y - s * z
    out[0, 2] = v * x * z + s * y
    out[1, 0] = v * x * y + s * z
    out[1, 1] = 1.0 - v * (x * x + z * z)
    out[1, 2] = v * y * z - s * x
    out[2, 0] = v * x * z - s * y
    out[2, 1] = v * y * z + s * x
    out[2, 2] = 1.0 - v * (x * x + y * y)
    return out


@kernel
def quaternion(rotation):
    """The unit quaternion (w, x, y, z) with w >= 0 of a rotation.

    Args:
        rotation: Rotation matrix. Shape (3, 3).

    Returns:
        Four numbers w, x, y, z.
    """
    return quaternion_of(
        (rotation[0, 0], rotation[0, 1], rotation[0, 2]),
        (rotation[1, 0], rotation[1, 1], rotation[1, 2]),
        (rotation[2, 0], rotation[2, 1], rotation[2, 2]),
    )


@inner
def quaternion_of(first, second, third):
    """:func:`quaternion` of a matrix given by its rows, three numbers each, by Shepperd's choice of the largest part.

    It keeps every division well away from 0/0, so that the quaternion is exact to rounding near 0 and near π alike.
    """
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = first, second, third
    trace = r00 + r11 + r22
    if trace >= r00 and trace >= r11 and trace >= r22:
        w = 1.0 + trace
        x = r21 - r12
        y = r02 - r20
        z = r10 - r01
    elif r00 >= r11 and r00 >= r22:
        w = r21 - r12
        x = 1.0 + r00 - r11 - r22
        y = r01 + r10
        z = r02 + r20
    elif r11 >= r22:
        w = r02 - r20
        x = r01 + r10
        y = 1.0 - r00 + r11 - r22
        z = r12 + r21
    else:
        w = r10 - r01
        x = r02 + r20
        y = r12 + r21
        z = 1.0 - r00 - r11 + r22
    scale = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    if w < 0.0:
        scale = -scale
    return scale * w, scale * x, scale * y, scale * z


@kernel
def rotation_vector(rotation):
    """The rotation vector (axis times angle) of a rotation, its angle between 0 and π.

    Replaces the arccos and the division by sin θ of Zhang 2020, eq. 52-54, which lose all digits near 0 and are
    0/0 at π. At exactly π both signs of the axis are right; one of them is returned.

    Args:
        rotation: Rotation matrix. Shape (3, 3).

    Returns:
        Rotation vector in [rad]. Shape (3,).
    """
    out = np.empty(3)
    w, x, y, z = quaternion(rotation)
    factor = vector_factor(w, x, y, z)
    out[0] = factor * x
    out[1] = factor * y
    out[2] = factor * z
    return out


@inner
def vector_factor(w, x, y, z):
    """The factor from the vector part of a unit quaternion with w >= 0 to the rotation vector."""
    sine = math.sqrt(x * x + y * y + z * z)
    # At 0 the factor angle / sine tends to 2.
    return 2.0 * math.atan2(sine, w) / sine if sine > 0.0 else 2.0


@kernel
def geodesic_angle(first, second):
    """The angle of the rotation that leads from one orientation to another.

    Args:
        first: Rotation matrix. Shape (3, 3).
        second: Rotation matrix. Shape (3, 3).

    Returns:
        Angle in [rad], between 0 and π.
    """
    w, x, y, z = quaternion_of(
        (_dot(second[0], first[0]), _dot(second[0], first[1]), _dot(second[0], first[2])),
        (_dot(second[1], first[0]), _dot(second[1], first[1]), _dot(second[1], first[2])),
        (_dot(second[2], first[0]), _dot(second[2], first[1]), _dot(second[2], first[2])),
    )
    return 2.0 * math.atan2(math.sqrt(x * x + y * y + z * z), w)


@inlined
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
