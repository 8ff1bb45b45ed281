"""Kernels of the damped inverse that the matrix of a bilinear actor may begin as, and of its gradient.

With J the Jacobian of the twist, in the frame in which twists are seen, U a diagonal metric of the joints and λ a
damping, which the network gives beside G and h,

    G + U Jᵀ (J U Jᵀ + λ I)⁻¹

takes the place of G (weighted damped least squares, as in Nakamura and Hanafusa 1986). An output is that of G and h,
then ln λ against the usual λ, then ln U; both logarithms are cut at ±:data:`LARGEST`.
"""

from __future__ import annotations

import math

import numpy as np

from baselines.solvers.linear_algebra import damped_gram, ldl, ldl_scaled_inverse
from ikgym.jit import inlined, kernel
from ikgym.rl.feature_kernels import seen_jacobian
from ikgym.rl.twists import is_turned, twist_size

#: Of the logarithms that a network gives.
LARGEST = 6.0


@kernel
def held_rows(kind, chain, damping, q, output, out):
    """(G, h) with the damped inverse in it, row by row.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        damping: The usual λ, above 0.
        q: Shape (B, n).
        output: Of the network. Shape (B, n (w + 1) + 1 + n).
        out: Receives (G, h), float64. Shape (B, n (w + 1)).
    """
    n, w = q.shape[1], twist_size(kind)
    geometric, scaled, inverse = np.empty((6, n)), np.empty((w, n)), np.empty((w, w))
    joints, metric, products = np.empty(n), np.empty(n), np.empty((w, n))
    rotation, position = np.empty((3, 3)), np.empty(3)
    for row in range(q.shape[0]):
        given, held = output[row], out[row]
        seen_jacobian(kind, chain, q[row], joints, rotation, position, geometric)
        lambda_ = damping * logarithm(given[n * (w + 1)])
        invert(geometric[:w], given[n * (w + 1) + 1 :], lambda_, metric, scaled, inverse, products)
        for j in range(n):
            for a in range(w):
                held[j * (w + 1) + a] = given[j * (w + 1) + a] + metric[j] * products[a, j]
            held[j * (w + 1) + w] = given[j * (w + 1) + w]


@kernel
def held_gradient_rows(kind, chain, damping, q, output, by_held, by_output, by_q):
    """From the gradient by what :func:`held_rows` gives to those by what it is given, row by row.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        damping: The usual λ.
        q: Shape (B, n).
        output: Of the network. Shape (B, n (w + 1) + 1 + n).
        by_held: The gradient by (G, h). Shape (B, n (w + 1)).
        by_output: Receives that by the output. Shape (B, n (w + 1) + 1 + n).
        by_q: Receives that by the joint coordinates. Shape (B, n).
    """
    n, w = q.shape[1], twist_size(kind)
    geometric, scaled, inverse = np.empty((6, n)), np.empty((w, n)), np.empty((w, w))
    joints, metric, products = np.empty(n), np.empty(n), np.empty((w, n))
    rotation, position = np.empty((3, 3)), np.empty(3)
    back, both, by_jacobian = np.empty((w, n)), np.empty((w, w)), np.zeros((6, n))
    for row in range(q.shape[0]):
        given, by, into = output[row], by_held[row], by_output[row]
        into[: n * (w + 1)] = by
        seen_jacobian(kind, chain, q[row], joints, rotation, position, geometric)
        lambda_ = damping * logarithm(given[n * (w + 1)])
        invert(geometric[:w], given[n * (w + 1) + 1 :], lambda_, metric, scaled, inverse, products)
        # M⁻¹ Bᵀ, with B the gradient by U Jᵀ M⁻¹.
        for a in range(w):
            for j in range(n):
                total = 0.0
                for b in range(w):
                    total += inverse[a, b] * by[j * (w + 1) + b]
                back[a, j] = total
        # C + Cᵀ, where −C is the gradient by M: C = M⁻¹ J U B M⁻¹.
        for a in range(w):
            for b in range(w):
                both[a, b] = 0.0
                for j in range(n):
                    both[a, b] += metric[j] * (products[a, j] * back[b, j] + products[b, j] * back[a, j])
        trace = 0.0
        for a in range(w):
            trace += 0.5 * both[a, a]
        into[n * (w + 1)] = -lambda_ * trace if abs(given[n * (w + 1)]) < LARGEST else 0.0
        for j in range(n):
            by_metric = 0.0
            for a in range(w):
                through = 0.0
                for b in range(w):
                    through += both[a, b] * geometric[b, j]
                by_metric += by[j * (w + 1) + a] * products[a, j] - 0.5 * geometric[a, j] * through
                by_jacobian[a, j] = metric[j] * (back[a, j] - through)
            own = n * (w + 1) + 1 + j
            into[own] = metric[j] * by_metric if abs(given[own]) < LARGEST else 0.0
        jacobian_gradient(geometric, by_jacobian, by_q[row])
        if is_turned(kind, chain.prismatic):
            by_q[row, 0] = 0.0


@inlined
def logarithm(number):
    """What a network says by a logarithm."""
    return math.exp(min(max(number, -LARGEST), LARGEST))


@kernel
def invert(jacobian, logarithms, damping, metric, scaled, inverse, products):
    """U, J √U, M⁻¹ and M⁻¹ J, with M = J U Jᵀ + λ I; NaN where it cannot be inverted, because a network gave NaN.

    Args:
        jacobian: J. Shape (w, n).
        logarithms: ln U. Shape (n,).
        damping: λ.
        metric: Receives U. Shape (n,).
        scaled: Receives J √U. Shape (w, n).
        inverse: Receives M⁻¹. Shape (w, w).
        products: Receives M⁻¹ J. Shape (w, n).
    """
    w, n = jacobian.shape
    for j in range(n):
        metric[j] = logarithm(logarithms[j])
        root = math.sqrt(metric[j])
        for a in range(w):
            scaled[a, j] = jacobian[a, j] * root
    factor = np.empty((w, w))
    damped_gram(scaled, damping, factor)
    if ldl(factor):
        ldl_scaled_inverse(factor, 1.0, inverse)
    else:
        inverse[:] = np.nan
    for a in range(w):
        for j in range(n):
            total = 0.0
            for b in range(w):
                total += inverse[a, b] * jacobian[b, j]
            products[a, j] = total


@kernel
def jacobian_gradient(jacobian, by, out):
    """From the gradient by the geometric Jacobian to that by the joint coordinates.

    With columns (v_i, ω_i), joint j turns those from itself on, and moves the tool for those before it:
    ∂v_i/∂q_j = ω_j × v_i and ∂ω_i/∂q_j = ω_j × ω_i for j ≤ i, ∂v_i/∂q_j = ω_i × v_j else. ω of a prismatic joint is 0.

    Args:
        jacobian: Shape (6, n).
        by: The gradient by it. Shape (6, n).
        out: Receives that by the joint coordinates. Shape (n,).
    """
    n = jacobian.shape[1]
    out[:] = 0.0
    for i in range(n):
        vx, vy, vz, wx, wy, wz = (
            jacobian[0, i], jacobian[1, i], jacobian[2, i], jacobian[3, i], jacobian[4, i], jacobian[5, i],
        )  # fmt: skip
        ax, ay, az, bx, by_, bz = by[0, i], by[1, i], by[2, i], by[3, i], by[4, i], by[5, i]
        # v × a + ω × b, which ω_j is multiplied by; and a × ω, which v_j is.
        tx = vy * az - vz * ay + wy * bz - wz * by_
        ty = vz * ax - vx * az + wz * bx - wx * bz
        tz = vx * ay - vy * ax + wx * by_ - wy * bx
        mx, my, mz = ay * wz - az * wy, az * wx - ax * wz, ax * wy - ay * wx
        for j in range(i + 1):
            out[j] += jacobian[3, j] * tx + jacobian[4, j] * ty + jacobian[5, j] * tz
        for j in range(i + 1, n):
            out[j] += jacobian[0, j] * mx + jacobian[1, j] * my + jacobian[2, j] * mz
