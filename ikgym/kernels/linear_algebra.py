"""Kernels of linear algebra for the small matrices of one arm.

`np.linalg` in numba needs SciPy and allocates at every call; at six rows neither pays.
"""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels.jit import inlined, inner, kernel

# Pivots below this share of the largest diagonal element are rounding: J has lost rank, or nearly so, and λ is too
# small to count. Singular values show which; to solve on would amplify the rounding.
SMALLEST_PIVOT = 1e-12


@inlined
def dot(a, b):
    """The scalar product; written out, since that of numba needs SciPy."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


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


@inner
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


@inner
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
    # A column that has shrunk to rounding errors has no direction, and would be rotated forever.
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


@inner
def pseudoinverse_rows(jacobian, shift, tolerance, full_rank, out, deficient):
    """Δq = J⁺ Δx by singular values, row by row.

    Args:
        jacobian: J. Shape (B, e, n).
        shift: Δx. Shape (B, e).
        tolerance: Singular values below this share of the largest count as zero.
        full_rank: The rank that J has where nothing is lost.
        out: Receives Δq. Shape (B, n).
        deficient: Receives whether the rank is lower. Shape (B,).
    """
    e, n = jacobian.shape[1], jacobian.shape[2]
    columns, left = np.empty((n, e)), np.empty((e, e))
    squares = np.empty(e)
    for row in range(jacobian.shape[0]):
        for a in range(e):
            for k in range(n):
                columns[k, a] = jacobian[row, a, k]
        singular_values(columns, left, squares)
        smallest = tolerance * tolerance * squares.max()
        rank = solve_by_singular_values(columns, left, squares, 0.0, smallest, shift[row], out[row])
        deficient[row] = rank < full_rank


@kernel
def singular_values(columns, left, squares):
    """Jᵀ = (V Σ) Uᵀ: ``columns`` (n, e) becomes V Σ, ``left`` (e, e) receives U and ``squares`` (e,) Σ²."""
    orthogonal_columns(columns, left)
    for a in range(squares.shape[0]):
        squares[a] = 0.0
        for k in range(columns.shape[0]):
            squares[a] += columns[k, a] * columns[k, a]


@inner
def solve_by_singular_values(columns, left, squares, damping, smallest, shift, out):
    """Δq = V Σ (Σ² + λ)⁻¹ Uᵀ Δx, which is J⁺ Δx without damping, see :func:`singular_values`.

    Args:
        columns: V Σ. Shape (n, e).
        left: U. Shape (e, e).
        squares: Σ². Shape (e,).
        damping: λ, at least 0.
        smallest: Σ² up to here are left out; at least 0.
        shift: Δx. Shape (e,).
        out: Receives Δq. Shape (n,).

    Returns:
        How many singular values are left.
    """
    out[:], rank = 0.0, 0
    for a in range(squares.shape[0]):
        if squares[a] <= smallest:
            continue
        rank += 1
        amount = 0.0
        for b in range(squares.shape[0]):
            amount += left[b, a] * shift[b]
        amount /= squares[a] + damping
        for k in range(out.shape[0]):
            out[k] += amount * columns[k, a]
    return rank


@inner
def damped_step(jacobian, error, damping, gram, x, out):
    """One damped step Δq = Jᵀ (J Jᵀ + λ I)⁻¹ e, in the small space (Zhang 2020, eq. 5 and 13).

    The matrix is factorised as L D Lᵀ, which needs no root and one division a row.

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
    if not ldl(gram):
        return False
    for a in range(x.shape[0]):
        x[a] = error[a]
    ldl_solve(gram, x)
    transposed_product(jacobian, x, out)
    return True


@inner
def damped_gram(jacobian, damping, out):
    """The lower triangle of J Jᵀ + λ I: shapes (e, n), a number, (e, e)."""
    e, n = jacobian.shape
    for a in range(e):
        for b in range(a + 1):
            total = damping if a == b else 0.0
            for k in range(n):
                total += jacobian[a, k] * jacobian[b, k]
            out[a, b] = total


@inner
def ldl(matrix):
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


@inner
def ldl_solve(factor, x):
    """Solves L D Lᵀ x = b in place; ``factor`` (e, e) from :func:`ldl`, ``x`` (e,) is b before."""
    e = x.shape[0]
    for k in range(e):
        for i in range(k + 1, e):
            x[i] -= factor[i, k] * x[k]
    for k in range(e):
        x[k] *= factor[k, k]
    for k in range(e - 1, 0, -1):
        for i in range(k):
            x[i] -= factor[k, i] * x[k]


@inner
def ldl_scaled_inverse(factor, scale, out):
    """Gives scale · (L D Lᵀ)⁻¹: shapes (e, e); ``factor`` from :func:`ldl` is destroyed."""
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


@inner
def transposed_product(jacobian, vector, out):
    """Jᵀ x: shapes (e, n), (e,), (n,)."""
    e, n = jacobian.shape
    for k in range(n):
        total = 0.0
        for a in range(e):
            total += jacobian[a, k] * vector[a]
        out[k] = total
