"""Kernels: one damped step Δq = Jᵀ (J Jᵀ + λ I)⁻¹ e, in the small space (Zhang 2020, eq. 5 and 13).

The matrix is factorised as L D Lᵀ, which needs no root and one division a row.
"""

from __future__ import annotations

import numpy as np

from ikgym.jit import kernel

# Pivots below this share of the largest diagonal element are rounding: J has lost rank, or nearly so, and λ is too
# small to count. Singular values tell which; solving on would amplify the rounding.
SMALLEST_PIVOT = 1e-12


@kernel
def damped_step(jacobian, error, damping, gram, x, out):
    """Δq = Jᵀ (J Jᵀ + λ I)⁻¹ e.

    Args:
        jacobian: J. Shape (e, n).
        error: e. Shape (e,).
        damping: λ, at least 0.
        gram: Scratch. Shape (e, e).
        x: Scratch. Shape (e,).
        out: Receives Δq. Shape (n,).

    Returns:
        False where J has lost rank and λ is too small to count; ``out`` is untouched then.
    """
    damped_gram(jacobian, damping, gram)
    if not factorise(gram):
        return False
    for a in range(x.shape[0]):
        x[a] = error[a]
    solve(gram, x)
    transposed_product(jacobian, x, out)
    return True


@kernel
def damped_gram(jacobian, damping, out):
    """The lower triangle of J Jᵀ + λ I: shapes (e, n), a number, (e, e)."""
    e, n = jacobian.shape
    for a in range(e):
        for b in range(a + 1):
            total = damping if a == b else 0.0
            for k in range(n):
                total += jacobian[a, k] * jacobian[b, k]
            out[a, b] = total


@kernel
def factorise(matrix):
    """L D Lᵀ in place: L below the diagonal, D⁻¹ on it; from the lower triangle of ``matrix`` (e, e).

    Returns:
        False where the matrix is not positive definite to working precision; then its content is of no use.
    """
    e = matrix.shape[0]
    largest = 0.0
    for j in range(e):
        largest = max(largest, matrix[j, j])
    for j in range(e):
        if not matrix[j, j] > SMALLEST_PIVOT * largest:
            return False
        inverse = 1.0 / matrix[j, j]
        matrix[j, j] = inverse
        for i in range(j + 1, e):
            share = matrix[i, j] * inverse
            for k in range(j + 1, i + 1):
                matrix[i, k] -= share * matrix[k, j]
        for i in range(j + 1, e):
            matrix[i, j] *= inverse
    return True


@kernel
def solve(factor, x):
    """Solves L D Lᵀ x = b in place; ``factor`` (e, e) from :func:`factorise`, ``x`` (e,) is b before."""
    e = x.shape[0]
    for k in range(e):
        for i in range(k + 1, e):
            x[i] -= factor[i, k] * x[k]
    for k in range(e):
        x[k] *= factor[k, k]
    for k in range(e - 1, 0, -1):
        for i in range(k):
            x[i] -= factor[k, i] * x[k]


@kernel
def scaled_inverse(factor, scale, out):
    """Gives scale · (L D Lᵀ)⁻¹: shapes (e, e); ``factor`` from :func:`factorise` is destroyed."""
    e = factor.shape[0]
    # L becomes its inverse, column by column from the right.
    for j in range(e - 2, -1, -1):
        for i in range(e - 1, j, -1):
            total = factor[i, j]
            for k in range(j + 1, i):
                total += factor[i, k] * factor[k, j]
            factor[i, j] = -total
    for a in range(e):
        for b in range(a + 1):
            total = factor[a, a] * (factor[a, b] if b < a else 1.0)
            for k in range(a + 1, e):
                total += factor[k, a] * factor[k, k] * factor[k, b]
            out[a, b] = out[b, a] = scale * total


@kernel
def transposed_product(jacobian, vector, out):
    """Jᵀ x: shapes (e, n), (e,), (n,)."""
    e, n = jacobian.shape
    for k in range(n):
        total = 0.0
        for a in range(e):
            total += jacobian[a, k] * vector[a]
        out[k] = total


@kernel
def ran_away(here, start, longest):
    """Whether a joint has gone farther than it can in one period: shapes (n,)."""
    excess = -np.inf
    for k in range(here.shape[0]):
        excess = max(excess, abs(here[k] - start[k]) - longest[k])
    return excess > 0.0
