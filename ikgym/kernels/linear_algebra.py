"""Kernels of linear algebra for small matrices: the Cholesky factorisation.

numba's own `np.linalg` needs SciPy and allocates at every call; at six rows neither pays.
"""

from __future__ import annotations

import math

from ikgym.kernels.jit import inner


@inner
def cholesky(matrix):
    """Cholesky factorisation in place: the lower triangle of ``matrix`` (m, m) becomes L with L Lᵀ = matrix.

    Returns:
        False where the matrix is not positive definite to working precision; then its content is of no use.
    """
    m = matrix.shape[0]
    for j in range(m):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k]
        if not pivot > 0.0:
            return False
        pivot = math.sqrt(pivot)
        matrix[j, j] = pivot
        for i in range(j + 1, m):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = value / pivot
    return True


@inner
def cholesky_solve(factor, rhs):
    """Solves L Lᵀ x = rhs in place; ``factor`` (m, m) from :func:`cholesky`, ``rhs`` (m,) becomes x."""
    m = rhs.shape[0]
    for i in range(m):
        for k in range(i):
            rhs[i] -= factor[i, k] * rhs[k]
        rhs[i] /= factor[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            rhs[i] -= factor[k, i] * rhs[k]
        rhs[i] /= factor[i, i]
