"""Kernels of linear algebra for the small matrices of one arm.

numba's own `np.linalg` needs SciPy and allocates at every call; at six rows neither pays.
"""

from __future__ import annotations

import math

from ikgym.jit import inlined, kernel


@inlined
def dot(a, b):
    """The scalar product; written out, since numba's own needs SciPy."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@kernel
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


@kernel
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


@kernel
def inverse_of_factor(factor, out):
    """(L Lᵀ)⁻¹, both triangles: ``factor`` (m, m) from :func:`cholesky` is destroyed; ``out`` (m, m)."""
    m = factor.shape[0]
    # L becomes its inverse, column by column from the right.
    for j in range(m - 1, -1, -1):
        factor[j, j] = 1.0 / factor[j, j]
        for i in range(m - 1, j, -1):
            total = 0.0
            for k in range(j + 1, i + 1):
                total += factor[i, k] * factor[k, j]
            factor[i, j] = -total * factor[j, j]
    for i in range(m):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, m):
                total += factor[k, i] * factor[k, j]
            out[i, j] = out[j, i] = total


@kernel
def orthogonal_columns(columns, rotations):
    """Singular value decomposition in place, by one-sided Jacobi rotations (Hestenes).

    ``columns`` (r, c) becomes U Σ, ``rotations`` (c, c) becomes V: at the start the matrix is columns, at the end
    it is columns · rotationsᵀ, and the columns are orthogonal. Small singular values come out with high relative
    accuracy, which the eigenvalues of JᵀJ would not.

    Args:
        columns: The matrix. Shape (r, c).
        rotations: Anything. Shape (c, c).
    """
    r, c = columns.shape
    for i in range(c):
        for j in range(c):
            rotations[i, j] = 1.0 if i == j else 0.0
    # A column that has shrunk to rounding errors has no direction of its own, and would be turned for ever.
    vanished = 0.0
    for i in range(r):
        for j in range(c):
            vanished += 1e-31 * columns[i, j] * columns[i, j]
    for _ in range(60):
        rotated = False
        for p in range(c - 1):
            for q in range(p + 1, c):
                a = b = d = 0.0
                for i in range(r):
                    a += columns[i, p] * columns[i, p]
                    b += columns[i, q] * columns[i, q]
                    d += columns[i, p] * columns[i, q]
                if min(a, b) <= vanished or abs(d) <= 1e-15 * math.sqrt(a * b):
                    continue
                rotated = True
                tau = (b - a) / (2.0 * d)
                t = math.copysign(1.0, tau) / (abs(tau) + math.sqrt(1.0 + tau * tau))
                cosine = 1.0 / math.sqrt(1.0 + t * t)
                sine = cosine * t
                for i in range(r):
                    x, y = columns[i, p], columns[i, q]
                    columns[i, p], columns[i, q] = cosine * x - sine * y, sine * x + cosine * y
                for i in range(c):
                    x, y = rotations[i, p], rotations[i, q]
                    rotations[i, p], rotations[i, q] = cosine * x - sine * y, sine * x + cosine * y
        if not rotated:
            return
