"""Kernel: the minimum of a strictly convex quadratic function in a box and on one side of planes, by a dual method."""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels.jit import inlined, inner, uncounted
from ikgym.kernels.linear_algebra import cholesky, dot

# A normal whose part off the active ones is below this share of it is a combination of them; a constraint that is
# missed by less, in units of its normal and relative to 1 or its bound, holds.
DEPENDENT, ROUNDING = 1e-9, 1e-11
# Steps for each variable before the search is given up.
MOST = 20
NONE = -1
# Weight of the slack of all rows against the squares of the variables: so large that the least slack is found exactly.
SLACK = 1e6


@inner
def row_minimum(hessian, linear, lower, upper, rows, bounds, count, x):
    """The x that minimises ½ xᵀ H x - gᵀ x between bounds and with aᵢᵀ x >= bᵢ, see :func:`dual_minimum`.

    Where no x in the box has all rows, the bounds of the variables hold. First each bᵢ is lowered to the largest aᵢᵀ x
    in the box, then all of them by the same amount, the smallest that will do.

    Args:
        hessian: H, symmetric and positive definite. Shape (n, n).
        linear: g. Shape (n,).
        lower: Lower bounds. Shape (n,).
        upper: Upper bounds, not below the lower ones. Shape (n,).
        rows: a. Shape (m, n).
        bounds: b; lowered where they have to be. Shape (m,).
        count: How many of the rows there are.
        x: Receives the minimum. Shape (n,).

    Returns:
        The number of steps, and whether the optimum was found; else x is in the box.
    """
    steps, found = dual_minimum(hessian, linear, lower, upper, rows, bounds, count, x)
    if found or count == 0:
        return steps, found
    for i in range(count):
        most = 0.0
        for j in range(x.shape[0]):
            most += max(rows[i, j] * lower[j], rows[i, j] * upper[j]) if rows[i, j] != 0.0 else 0.0
        bounds[i] = min(bounds[i], most)
    more, slack = least_slack(lower, upper, rows, bounds, count, x)
    for i in range(count):
        bounds[i] -= slack
    again = np.empty_like(x)
    last, relaxed = dual_minimum(hessian, linear, lower, upper, rows, bounds, count, again)
    if relaxed:
        x[:] = again
    return steps + more + last, relaxed


@inner
def least_slack(lower, upper, rows, bounds, count, x):
    """The smallest t with aᵢᵀ x + t >= bᵢ for an x in the box: the number of steps, and a t a little above it.

    t is one more variable of ½ ‖x‖² + ½ t² + SLACK t. A linear programme has the same solution as one with so small a
    quadratic part (Mangasarian and Meyer 1979). ``x`` receives that solution; see :func:`row_minimum`.
    """
    n = x.shape[0]
    hessian, linear, solution = np.eye(n + 1), np.zeros(n + 1), np.empty(n + 1)
    low, high, sides = np.zeros(n + 1), np.full(n + 1, np.inf), np.ones((count, n + 1))
    low[:n], high[:n], sides[:, :n], linear[n] = lower, upper, rows[:count], -SLACK
    steps, _ = dual_minimum(hessian, linear, low, high, sides, bounds, count, solution)
    x[:], slack = solution[:n], 0.0
    for i in range(count):
        slack = max(slack, bounds[i] - dot(rows[i], x))
    return steps, slack * (1.0 + 1e-7) + 1e-9


@inner
def dual_minimum(hessian, linear, lower, upper, rows, bounds, count, x):
    """The minimum by the dual active set of Goldfarb and Idnani (1983); see :func:`row_minimum` for the arguments.

    It begins at the minimum without constraints. The constraint that is missed by most joins the active ones, and x
    goes to the minimum on all of them; one whose multiplier would become negative on the way is dropped. Each step
    raises the function, so that no active set comes twice.

    Returns:
        The number of steps, and whether the optimum was found; else there is no such x, or the matrix is not positive
        definite, and x is in the box.
    """
    n = x.shape[0]
    work = np.empty((2, n, n)), np.empty((4, n)), np.zeros(n + 1), np.empty(n, np.int64)
    return _search(hessian, linear, lower, upper, rows, bounds, count, x, work)


@uncounted
def _search(hessian, linear, lower, upper, rows, bounds, count, x, work):
    """See :func:`dual_minimum`, which makes the arrays that this works with."""
    (matrices, vectors, multipliers, active), n = work, x.shape[0]
    basis, triangle = matrices[0], matrices[1]
    normal, along, step, change = vectors[0], vectors[1], vectors[2], vectors[3]
    if not _start(hessian, linear, triangle, basis, x):
        return 0, _into_box(x, lower, upper, active, -1)
    size, steps = 0, 0
    entering = _most_missed(lower, upper, rows, bounds, count, x, active, size)
    while entering != NONE and steps < MOST * n:
        multipliers[size], added = 0.0, False
        _normal(entering, rows, normal)
        while not added and steps < MOST * n:
            steps += 1
            free = _directions(basis, triangle, normal, size, along, step, change)
            missing = _missing(entering, lower, upper, rows, bounds, x)
            full = missing / dot(step, normal) if free else math.inf
            part, leaving = _longest(multipliers, change, size)
            length = min(part, full)
            if length == math.inf:
                return steps, _into_box(x, lower, upper, active, -1)
            for j in range(size):
                multipliers[j] -= length * change[j]
            multipliers[size] += length
            if free:
                for j in range(n):
                    x[j] += length * step[j]
            if full <= part:
                _add(basis, triangle, along, size)
                active[size], added = entering, True
                size += 1
            else:
                size = _drop(basis, triangle, active, multipliers, size, leaving)
        entering = _most_missed(lower, upper, rows, bounds, count, x, active, size)
    _into_box(x, lower, upper, active, size)
    return steps + 1, entering == NONE


@uncounted
def _start(hessian, linear, factor, basis, x):
    """The minimum without constraints, and L⁻ᵀ of H = L Lᵀ as the basis; whether H is positive definite."""
    n = x.shape[0]
    for i in range(n):
        x[i] = 0.0
        for j in range(i + 1):
            factor[i, j] = hessian[i, j]
    if not cholesky(factor):
        return False
    for j in range(n):  # column j of L⁻¹ is row j of the basis
        for i in range(n):
            total = 1.0 * (i == j)
            for k in range(j, i):
                total -= factor[i, k] * basis[j, k]
            basis[j, i] = total / factor[i, i] if i >= j else 0.0
    for i in range(n):
        share = 0.0
        for k in range(i + 1):
            share += basis[k, i] * linear[k]
        for j in range(i + 1):
            x[j] += basis[j, i] * share
    return True


@inlined
def _into_box(x, lower, upper, active, size):
    """Takes rounding off x: active bounds are met exactly. Returns False."""
    n = x.shape[0]
    for j in range(n):
        x[j] = min(max(x[j], lower[j]), upper[j])
    for i in range(size):
        if active[i] < n:
            x[active[i]] = lower[active[i]]
        elif active[i] < 2 * n:
            x[active[i] - n] = upper[active[i] - n]
    return False


@inlined
def _normal(constraint, rows, normal):
    """The normal of a constraint: first lower bounds, then upper ones, then rows."""
    n = normal.shape[0]
    for j in range(n):
        normal[j] = rows[constraint - 2 * n, j] if constraint >= 2 * n else 0.0
    if constraint < 2 * n:
        normal[constraint % n] = 1.0 if constraint < n else -1.0


@inlined
def _missing(constraint, lower, upper, rows, bounds, x):
    """How much a constraint is missed by; below 0 where it holds."""
    n = x.shape[0]
    if constraint < n:
        return lower[constraint] - x[constraint]
    if constraint < 2 * n:
        return x[constraint - n] - upper[constraint - n]
    return bounds[constraint - 2 * n] - dot(rows[constraint - 2 * n], x)


@uncounted
def _most_missed(lower, upper, rows, bounds, count, x, active, size):
    """The constraint that x misses by most, relative to the length of its normal; NONE if all of them hold."""
    n, found, most = x.shape[0], NONE, 0.0
    for k in range(2 * n + count):
        missing, scale = _missing(k, lower, upper, rows, bounds, x), 1.0
        if missing <= 0.0:
            continue
        if k >= 2 * n:
            scale = math.sqrt(dot(rows[k - 2 * n], rows[k - 2 * n]))
        bound = lower[k] if k < n else upper[k - n] if k < 2 * n else bounds[k - 2 * n]
        if missing <= ROUNDING * max(scale, abs(bound)) or missing <= most * scale:
            continue
        fresh = True
        for i in range(size):  # at the other bound of a variable, this one is missed by rounding alone
            fresh = fresh and active[i] != k and not (k < 2 * n and active[i] < 2 * n and (active[i] - k) % n == 0)
        if fresh:
            found, most = k, missing / scale if scale > 0.0 else math.inf
    return found


@uncounted
def _directions(basis, triangle, normal, size, along, step, change):
    """Where x goes with the multiplier of a constraint: ``step``, and ``change``, by how much the others decrease.

    The first columns of the basis J span the active normals, Jᵀ N = R, the triangle; ``along`` receives Jᵀ times the
    normal. Returns whether x can move; else the normal is a combination of the active ones.
    """
    n, whole, rest = normal.shape[0], 0.0, 0.0
    for i in range(n):
        along[i] = 0.0
        for j in range(n):
            along[i] += basis[j, i] * normal[j]
        whole += along[i] * along[i]
        rest += along[i] * along[i] if i >= size else 0.0
    for j in range(n):
        step[j] = 0.0
        for i in range(size, n):
            step[j] += basis[j, i] * along[i]
    for i in range(size - 1, -1, -1):
        change[i] = along[i]
        for k in range(i + 1, size):
            change[i] -= triangle[i, k] * change[k]
        change[i] /= triangle[i, i]
    return rest > DEPENDENT * DEPENDENT * whole


@inlined
def _longest(multipliers, change, size):
    """The length at which the first multiplier becomes 0, and which one; inf if none decreases."""
    longest, leaving = math.inf, NONE
    for i in range(size):
        if change[i] > 0.0 and multipliers[i] < longest * change[i]:
            longest, leaving = max(multipliers[i], 0.0) / change[i], i
    return longest, leaving


@inlined
def _rotate(basis, first, second, a, b):
    """Turns two columns of the basis so that (a, b) becomes (the length of it, 0), and returns cosine and sine."""
    length = math.hypot(a, b)
    if length == 0.0:
        return 1.0, 0.0
    c, s = a / length, b / length
    for j in range(basis.shape[0]):
        u, v = basis[j, first], basis[j, second]
        basis[j, first], basis[j, second] = c * u + s * v, c * v - s * u
    return c, s


@uncounted
def _add(basis, triangle, along, size):
    """Makes a constraint active: its normal, Jᵀ n = ``along``, becomes one more column of R."""
    for i in range(along.shape[0] - 1, size, -1):
        c, s = _rotate(basis, i - 1, i, along[i - 1], along[i])
        along[i - 1] = c * along[i - 1] + s * along[i]
    for i in range(size + 1):
        triangle[i, size] = along[i]


@uncounted
def _drop(basis, triangle, active, multipliers, size, leaving):
    """Drops an active constraint, and returns how many are left; the multiplier behind the last moves up with them."""
    for i in range(leaving, size):
        multipliers[i] = multipliers[i + 1]
    for i in range(leaving, size - 1):
        active[i] = active[i + 1]
        for k in range(i + 2):
            triangle[k, i] = triangle[k, i + 1]
        c, s = _rotate(basis, i, i + 1, triangle[i, i], triangle[i + 1, i])
        triangle[i, i], triangle[i + 1, i] = c * triangle[i, i] + s * triangle[i + 1, i], 0.0
        for k in range(i + 2, size):
            u, v = triangle[i, k], triangle[i + 1, k]
            triangle[i, k], triangle[i + 1, k] = c * u + s * v, c * v - s * u
    return size - 1
