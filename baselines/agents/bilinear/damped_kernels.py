"""Kernels of the damped inverse to which a bilinear agent adds its matrix, and of its gradient.

With J the Jacobian of the twist, in the frame in which twists are seen, U a diagonal metric of the joints and λ a
damping, which the network gives beside G and h,

    G' = G + U Jᵀ (J U Jᵀ + λ I)⁻¹

replaces G (weighted damped least squares, as in Nakamura and Hanafusa 1986), and its projection into the null space,
h' = (I - G' J) h, replaces h. An output holds G and h, then ln λ relative to the initial λ, then ln U; both logarithms
are clipped at ±:data:`LARGEST`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.agents.bilinear.features import seen_jacobian
from baselines.solvers.linear_algebra import damped_gram, ldl, ldl_scaled_inverse
from ikgym.kernels.jit import expanded, inlined, inner, kernel
from ikgym.rl.twists import is_turned, twist_size

Floats = npt.NDArray[np.float64]

#: Bound of the logarithms.
LARGEST = 6.0


class Inverse(NamedTuple):
    """The damped inverse of one arm, and its parts.

    Attributes:
        jacobian: J, as :func:`baselines.agents.bilinear.features.seen_jacobian` gives it. Shape (6, n).
        metric: The diagonal of U. Shape (n,).
        inverse: M⁻¹, with M = J U Jᵀ + λ I. Shape (w, w).
        products: M⁻¹ J. Shape (w, n).
    """

    jacobian: Floats
    metric: Floats
    inverse: Floats
    products: Floats


@expanded
def empty_inverse(w, n):
    """An uninitialised one."""
    return Inverse(np.empty((6, n)), np.empty(n), np.empty((w, w)), np.empty((w, n)))


@kernel
def held_rows(kind, chain, damping, q, output, out):
    """(G', h'), row by row.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        damping: The initial λ, above 0.
        q: Shape (B, n).
        output: Of the network. Shape (B, n (w + 1) + 1 + n).
        out: Receives (G', h'), float64. Shape (B, n (w + 1)).
    """
    n, w = q.shape[1], twist_size(kind)
    found, moved = empty_inverse(w, n), np.empty(w)
    for row in range(q.shape[0]):
        given, held = output[row], out[row]
        invert(kind, chain, damping, q[row], given[n * (w + 1) :], found)
        tool_motion(found.jacobian, given, moved)
        for j in range(n):
            own = j * (w + 1)
            held[own + w] = given[own + w]
            for a in range(w):
                held[own + a] = given[own + a] + found.metric[j] * found.products[a, j]
                held[own + w] -= held[own + a] * moved[a]


@kernel
def held_gradient_rows(kind, chain, damping, q, output, by_held, by_output, by_q):
    """The adjoint of :func:`held_rows`, row by row.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        damping: The initial λ.
        q: Shape (B, n).
        output: Of the network. Shape (B, n (w + 1) + 1 + n).
        by_held: The gradient with respect to (G', h'). Shape (B, n (w + 1)).
        by_output: Receives that with respect to the output. Shape (B, n (w + 1) + 1 + n).
        by_q: Receives that with respect to the joint coordinates. Shape (B, n).
    """
    n, w = q.shape[1], twist_size(kind)
    rows = n * (w + 1)
    found = empty_inverse(w, n)
    by_jacobian, moved, by_moved = np.zeros((6, n)), np.empty(w), np.empty(w)
    for row in range(q.shape[0]):
        given, logarithms, into = output[row], output[row, rows:], by_output[row]
        into[:rows] = by_held[row]
        lambda_ = invert(kind, chain, damping, q[row], logarithms, found)
        through_null_motion(found, given, moved, by_moved, into)
        through_inverse(found, lambda_, into, into[rows:], by_jacobian)
        for a in range(w):
            for j in range(n):
                by_jacobian[a, j] += by_moved[a] * given[j * (w + 1) + w]
        for i in range(1 + n):
            if abs(logarithms[i]) >= LARGEST:
                into[rows + i] = 0.0
        jacobian_gradient(found.jacobian, by_jacobian, by_q[row])
        if is_turned(kind, chain.prismatic):
            by_q[row, 0] = 0.0


@inner
def invert(kind, chain, damping, q, given, found):
    """Fills an :class:`Inverse`; an output that is NaN leads to NaN.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        damping: The initial λ.
        q: Shape (n,).
        given: ln λ relative to the initial one, and ln U. Shape (1 + n,).
        found: Receives the inverse.

    Returns:
        λ.
    """
    w, n = found.products.shape
    scaled, factor = np.empty((w, n)), np.empty((w, w))
    seen_jacobian(kind, chain, q, np.empty(n), np.empty((3, 3)), np.empty(3), found.jacobian)
    lambda_ = damping * from_logarithm(given[0])
    for j in range(n):
        found.metric[j] = from_logarithm(given[1 + j])
        root = math.sqrt(found.metric[j])
        for a in range(w):
            scaled[a, j] = found.jacobian[a, j] * root
    damped_gram(scaled, lambda_, factor)
    if ldl(factor):
        ldl_scaled_inverse(factor, 1.0, found.inverse)
    else:
        found.inverse[:] = np.nan
    for a in range(w):
        for j in range(n):
            total = 0.0
            for b in range(w):
                total += found.inverse[a, b] * found.jacobian[b, j]
            found.products[a, j] = total
    return lambda_


@inlined
def tool_motion(jacobian, given, moved):
    """J h, the motion of the tool that h alone causes."""
    w, n = moved.shape[0], jacobian.shape[1]
    for a in range(w):
        moved[a] = 0.0
        for j in range(n):
            moved[a] += jacobian[a, j] * given[j * (w + 1) + w]


@inner
def through_null_motion(found, given, moved, by_moved, by):
    """From the gradient with respect to G' and h' = h - G' (J h) to those with respect to G', h and J h.

    Args:
        found: An :class:`Inverse`.
        given: Of the network. Shape (n (w + 1) + 1 + n,).
        moved: Receives J h. Shape (w,).
        by_moved: Receives the gradient with respect to J h. Shape (w,).
        by: The gradient with respect to (G', h'); receives that with respect to (G', h). Shape (n (w + 1) or more,).
    """
    w, n = found.products.shape
    tool_motion(found.jacobian, given, moved)
    by_moved[:] = 0.0
    for j in range(n):
        own = j * (w + 1)
        by_null = by[own + w]
        for a in range(w):
            by_moved[a] -= (given[own + a] + found.metric[j] * found.products[a, j]) * by_null
            by[own + a] -= by_null * moved[a]
    for j in range(n):
        for a in range(w):
            by[j * (w + 1) + w] += by_moved[a] * found.jacobian[a, j]


@inlined
def from_logarithm(number):
    """The number whose logarithm is an output."""
    return math.exp(min(max(number, -LARGEST), LARGEST))


@inner
def through_inverse(found, damping, by, by_logarithms, by_jacobian):
    """From the gradient B with respect to G' to those with respect to λ, U and J.

    With P = M⁻¹ J and C = P U B M⁻¹, that with respect to M is −C; through M = J U Jᵀ + λ I follows C + Cᵀ.

    Args:
        found: An :class:`Inverse`.
        damping: λ.
        by: That with respect to (G', h), with B in its rows. Shape (n (w + 1) or more,).
        by_logarithms: Receives those with respect to ln λ and ln U. Shape (1 + n,).
        by_jacobian: Receives that with respect to J, in its first rows. Shape (6, n).
    """
    jacobian, metric, inverse, products = found
    w, n = products.shape
    back, both, trace = np.zeros((w, n)), np.zeros((w, w)), 0.0
    for j in range(n):
        for a in range(w):
            for b in range(w):
                back[a, j] += inverse[a, b] * by[j * (w + 1) + b]  # M⁻¹ Bᵀ
        for a in range(w):
            for b in range(w):
                both[a, b] += metric[j] * (products[a, j] * back[b, j] + products[b, j] * back[a, j])
    for a in range(w):
        trace += 0.5 * both[a, a]
    by_logarithms[0] = -damping * trace
    for j in range(n):
        by_metric = 0.0
        for a in range(w):
            through = 0.0
            for b in range(w):
                through += both[a, b] * jacobian[b, j]
            by_metric += by[j * (w + 1) + a] * products[a, j] - 0.5 * jacobian[a, j] * through
            by_jacobian[a, j] = metric[j] * (back[a, j] - through)
        by_logarithms[1 + j] = metric[j] * by_metric


@inner
def jacobian_gradient(jacobian, by, out):
    """From the gradient with respect to the geometric Jacobian to that with respect to the joint coordinates.

    With columns (v_i, ω_i), joint j rotates the columns i ≥ j and moves the tool for those before it:
    ∂v_i/∂q_j = ω_j × v_i and ∂ω_i/∂q_j = ω_j × ω_i for j ≤ i, ∂v_i/∂q_j = ω_i × v_j else. ω of a prismatic joint is 0.

    Args:
        jacobian: Shape (6, n).
        by: The gradient with respect to it. Shape (6, n).
        out: Receives that with respect to the joint coordinates. Shape (n,).
    """
    n = jacobian.shape[1]
    out[:] = 0.0
    for i in range(n):
        vx, vy, vz, wx, wy, wz = (
            jacobian[0, i], jacobian[1, i], jacobian[2, i], jacobian[3, i], jacobian[4, i], jacobian[5, i],
        )  # fmt: skip
        ax, ay, az, bx, by_, bz = by[0, i], by[1, i], by[2, i], by[3, i], by[4, i], by[5, i]
        # The factors of ω_j, v × a + ω × b, and of v_j, a × ω.
        tx = vy * az - vz * ay + wy * bz - wz * by_
        ty = vz * ax - vx * az + wz * bx - wx * bz
        tz = vx * ay - vy * ax + wx * by_ - wy * bx
        mx, my, mz = ay * wz - az * wy, az * wx - ax * wz, ax * wy - ay * wx
        for j in range(i + 1):
            out[j] += jacobian[3, j] * tx + jacobian[4, j] * ty + jacobian[5, j] * tz
        for j in range(i + 1, n):
            out[j] += jacobian[0, j] * mx + jacobian[1, j] * my + jacobian[2, j] * mz
