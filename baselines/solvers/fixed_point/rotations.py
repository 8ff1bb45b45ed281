"""Kernels of abstract rotations: rotations of Rⁿ that mix two directions only (Khan 2020, section 2).

The matrix ``O = I + sin ξ G + (1 - cos ξ) G²`` with ``G = e_a e_bᵀ - e_b e_aᵀ`` (eq. 2.10, 2.11) is never set up: it
differs from I by two rows and columns, so that a vector is turned with four scalar products.
"""

from __future__ import annotations

import math

from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.linear_algebra import dot

# A unit vector this close to another one, or to its opposite, spans no plane with it: the rest is rounding.
PARALLEL = 1e-15


@inner
def plane(source, goal, e_a, e_b):
    """The plane and the angle of the rotation that turns one vector into the direction of another.

    Between opposite vectors the plane is not determined; one through the coordinate axis furthest from them is taken.

    Args:
        source: The vector to be rotated, b. Shape (n,), with n of at least 2.
        goal: Where to, a. Shape (n,).
        e_a: Receives the unit vector of a's part orthogonal to b, or zeros where nothing turns. Shape (n,).
        e_b: Receives the unit vector of b, or zeros. Shape (n,).

    Returns:
        The angle in [rad], between 0 and π; 0 where one of the vectors is zero.
    """
    n = source.shape[0]
    e_a[:] = 0.0
    e_b[:] = 0.0
    source_norm, goal_norm = math.sqrt(dot(source, source)), math.sqrt(dot(goal, goal))
    if source_norm == 0.0 or goal_norm == 0.0:
        return 0.0
    for i in range(n):
        e_b[i] = source[i] / source_norm
        e_a[i] = goal[i] / goal_norm
    cosine, sine = _make_orthogonal(e_a, e_b)
    if sine <= PARALLEL:
        e_a[:] = 0.0
        if cosine > 0.0:
            return 0.0
        furthest = 0
        for i in range(n):
            if abs(e_b[i]) < abs(e_b[furthest]):
                furthest = i
        e_a[furthest] = 1.0
        _make_orthogonal(e_a, e_b)
    # Once more: near parallel vectors the first difference is mostly rounding.
    _make_orthogonal(e_a, e_b)
    return math.atan2(sine, cosine)


@kernel
def turn(e_a, e_b, angle, vector):
    """Turns a vector in place by eq. 2.11; exactly that matrix also where e_a and e_b are no unit vectors.

    Args:
        e_a: First vector of the plane. Shape (n,).
        e_b: Second vector of the plane; the rotation leads from it to the first. Shape (n,).
        angle: ξ in [rad].
        vector: Is turned. Shape (n,).
    """
    a, b = dot(e_a, vector), dot(e_b, vector)
    aa, ab, bb = dot(e_a, e_a), dot(e_a, e_b), dot(e_b, e_b)
    sine = math.sin(angle)
    # 1 - cos loses all digits near 0; 2 sin² of the half does not.
    half = math.sin(0.5 * angle)
    versine = 2.0 * half * half
    # G v = b e_a - a e_b, and once more G.
    along_a = sine * b + versine * (ab * b - bb * a)
    along_b = -sine * a - versine * (aa * b - ab * a)
    for i in range(vector.shape[0]):
        vector[i] += along_a * e_a[i] + along_b * e_b[i]


@inner
def adaptive_deform(actual, deformed, desired, rule, extended, out):
    """The function AdaptiveDeform of section 4.1: a share of the rotation from B to A, applied to C.

    The three vectors get one dimension more, in which they reach the common length R_a; the listing's ``B'*B`` is
    read as ``A'*B``, without which nothing is orthogonal to B.

    Args:
        actual: b, ``realized_prev``. Shape (n,).
        deformed: c, ``deformed_prev``. Shape (n,).
        desired: a, ``desired_now``. Shape (n,).
        rule: R_a, λ_a, ``epsa`` and ``q_pp_max``.
        extended: Scratch. Shape (3, n + 1).
        out: Receives the deformed vector. Shape (n,).

    Returns:
        The angle λ_a φ in [rad], of which φ is taken to be at most π/2 by the listing's asin; NaN, with ``out``
        untouched, where one of the vectors is not shorter than R_a, so that nothing could be turned.
    """
    radius, share, epsilon, largest = rule
    a, b, c = extended[0], extended[1], extended[2]
    if not (_extend(desired, radius, a) and _extend(actual, radius, b) and _extend(deformed, radius, c)):
        return math.nan
    along = dot(a, b) / (radius * radius)
    for i in range(a.shape[0]):
        a[i] -= along * b[i]
    norm = math.sqrt(dot(a, a))
    for i in range(a.shape[0]):
        a[i] /= epsilon + norm
        b[i] /= radius
    angle = share * math.asin(min(1.0, norm / radius))
    turn(a, b, angle, c)
    for i in range(out.shape[0]):
        out[i] = largest * math.tanh(c[i] / largest)
    return angle


@inner
def _make_orthogonal(vector, unit):
    """Takes from a vector its part along a unit vector and gives it length 1; returns both parts' lengths."""
    along = dot(vector, unit)
    for i in range(vector.shape[0]):
        vector[i] -= along * unit[i]
    rest = math.sqrt(dot(vector, vector))
    if rest > 0.0:
        for i in range(vector.shape[0]):
            vector[i] /= rest
    return along, rest


@inner
def _extend(vector, radius, out):
    """Appends the number that makes the length R_a; False where the vector is too long for that."""
    n = vector.shape[0]
    left = radius * radius - dot(vector, vector)
    if not left > 0.0:
        return False
    for i in range(n):
        out[i] = vector[i]
    out[n] = math.sqrt(left)
    return True
