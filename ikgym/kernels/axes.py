"""Kernels of the direction of the tool: the error between two axes in two numbers, and its derivative.

Two numbers need two directions across the desired axis z*, and no choice of them is continuous for all z* (the hairy
ball theorem). Here the directions of one frame are carried to z* by the smallest rotation, which is continuous
everywhere but at :data:`SINGULAR`, a direction in which tools seldom point. The length of the error, the angle between
the axes, does not depend on that choice.
"""

from __future__ import annotations

import math

from ikgym.kernels.jit import inlined, inner, kernel

#: The desired axis at which the two directions are not continuous.
SINGULAR = (6.0 / 11.0, 6.0 / 11.0, 7.0 / 11.0)

# The direction whose frame is carried along, and a direction across it.
_A = (-SINGULAR[0], -SINGULAR[1], -SINGULAR[2])
_P = (math.sqrt(0.5), -math.sqrt(0.5), 0.0)
# Nearer to SINGULAR than this, in (a + z)², the first direction is that there.
_LEAST = 1e-24
# Below this angle in [rad], series replace 0/0.
_SMALL = 1e-3


@kernel
def across(x, y, z):
    """Two directions across a unit axis, which form a right-handed frame with it.

    Returns:
        The six numbers of both.
    """
    sx, sy, sz = _A[0] + x, _A[1] + y, _A[2] + z
    square = sx * sx + sy * sy + sz * sz
    # The smallest rotation from a to z takes v, which is across a, to its reflection v - 2 (v · s) / s² s, s = a + z.
    p = 0.0
    if square > _LEAST:
        p = 2.0 * (_P[0] * sx + _P[1] * sy + _P[2] * sz) / square
    ux, uy, uz = _P[0] - p * sx, _P[1] - p * sy, _P[2] - p * sz
    # Near SINGULAR s has lost digits: the rest along z is taken out, and the third direction follows from two.
    along = ux * x + uy * y + uz * z
    ux, uy, uz = ux - along * x, uy - along * y, uz - along * z
    return ux, uy, uz, y * uz - z * uy, z * ux - x * uz, x * uy - y * ux


@inlined
def _parts(nominal, actual):
    """Sine times the direction of the error, and the cosine of the angle; exactly 0 where both axes are the same."""
    ux, uy, uz, vx, vy, vz = across(nominal[0], nominal[1], nominal[2])
    x, y, z = actual[0] - nominal[0], actual[1] - nominal[1], actual[2] - nominal[2]
    cosine = nominal[0] * actual[0] + nominal[1] * actual[1] + nominal[2] * actual[2]
    return vx * x + vy * y + vz * z, -(ux * x + uy * y + uz * z), cosine


@inner
def direction_error(nominal, actual):
    """The rotation vector that takes an axis to the desired one by the shortest way, along the two directions across.

    Its length is the angle between the axes, from 0 to π. At exactly π every direction is right; one is returned.

    Args:
        nominal: z*, a unit vector. Shape (3,), or longer.
        actual: z, a unit vector. Shape (3,), or longer.

    Returns:
        Both components in [rad].
    """
    first, second, cosine = _parts(nominal, actual)
    sine = math.hypot(first, second)
    if sine == 0.0:
        return (0.0 if cosine > 0.0 else math.pi), 0.0
    factor = math.atan2(sine, cosine) / sine
    return factor * first, factor * second


@inner
def direction_error_jacobian(nominal, actual, jacobian, out):
    """Derivative of :func:`direction_error` by the joint coordinates.

    Args:
        nominal: z*. Shape (3,), or longer.
        actual: z. Shape (3,), or longer.
        jacobian: Angular velocities of z along the two directions across it. Shape (2, n).
        out: Receives the derivative. Shape (2, n).
    """
    first, second, cosine = _parts(nominal, actual)
    sine = math.hypot(first, second)
    angle = math.atan2(sine, cosine)
    # The factor θ / sin θ, and its derivative by cos θ, (θ cos θ - sin θ) / sin³ θ.
    if angle < _SMALL:
        factor, slope = 1.0 + angle * angle / 6.0, -1.0 / 3.0 - 2.0 * angle * angle / 15.0
    else:
        factor, slope = angle / sine, (angle * cosine - sine) / (sine * sine * sine)
    ux, uy, uz, vx, vy, vz = across(nominal[0], nominal[1], nominal[2])
    ax, ay, az, bx, by, bz = across(actual[0], actual[1], actual[2])
    for j in range(jacobian.shape[1]):
        # z' = ω × z, where ω = ω_a a + ω_b b and (a, b, z) is a right-handed frame.
        along_a, along_b = jacobian[0, j], jacobian[1, j]
        x, y, z = along_b * ax - along_a * bx, along_b * ay - along_a * by, along_b * az - along_a * bz
        by_cosine = slope * (nominal[0] * x + nominal[1] * y + nominal[2] * z)
        out[0, j] = factor * (vx * x + vy * y + vz * z) + first * by_cosine
        out[1, j] = -factor * (ux * x + uy * y + uz * z) + second * by_cosine


@inlined
def angle_between(x, y, z, u, v, w):
    """The angle between two axes in [rad], exact to rounding near 0 and near π alike."""
    i, j, k = y * w - z * v, z * u - x * w, x * v - y * u
    return math.atan2(math.sqrt(i * i + j * j + k * k), x * u + y * v + z * w)
