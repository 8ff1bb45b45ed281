"""Kernel: the minimum of a strictly convex quadratic function in a box, by an active set."""

from __future__ import annotations

import numpy as np

from ikgym.kernels.jit import inlined, inner, uncounted
from ikgym.kernels.linear_algebra import cholesky, cholesky_solve

# State of a variable: free, or at its lower or upper bound. One that is kept was released by rounding alone, and stays
# at its bound until the others have moved.
FREE, BOUND, KEPT = 0, 1, 2
# A slope of this share of its terms is rounding, and no reason to leave a bound.
ROUNDING = 1e-13
# Solves for each variable before the search is given up; problems of 8 variables have taken 2 to 12 in all.
MOST = 20
NONE = -1


@inner
def box_minimum(hessian, linear, lower, upper, x):
    """The x between bounds that minimises ½ xᵀ H x - gᵀ x, by the active set of Stark and Parker (1995).

    Free variables are solved for. Where that leads out of the box, x goes as far as the first bound, where that
    variable stays. Where it does not, the variable that its bound holds back the most is released. Each solve lowers
    the function, so that no active set comes twice, and the last one is that of the optimum. The first active set is
    that of the unconstrained minimum, cut to the box.

    Args:
        hessian: H, symmetric and positive definite. Shape (n, n).
        linear: g. Shape (n,).
        lower: Lower bounds. Shape (n,).
        upper: Upper bounds, not below the lower ones. Shape (n,).
        x: Receives the minimum. Shape (n,).

    Returns:
        The number of solves, and whether the optimum was found; else the matrix is not positive definite, and x is 0
        or the last point in the box.
    """
    n = x.shape[0]
    state, factor, target = np.full(n, FREE), np.empty((n, n)), np.empty(n)
    x[:] = 0.0
    if not _solve(hessian, linear, x, state, factor, target):
        return 1, False
    if _cut(target, lower, upper, x, state):
        return 1, True
    released = NONE
    for solves in range(2, MOST * n + 1):
        if not _solve(hessian, linear, x, state, factor, target):
            return solves, False
        if released != NONE and not _inwards(x[released], target[released], lower[released]):
            state[released] = KEPT
        else:
            inside = _advance(target, lower, upper, x, state)
            for j in range(n):
                state[j] = min(state[j], BOUND)
            if not inside:
                released = NONE
                continue
        released = _most_held_back(hessian, linear, lower, upper, x, state)
        if released == NONE:
            return solves, True
        state[released] = FREE
    return MOST * n, False


@inlined
def _inwards(at, target, lower):
    """Whether a variable leaves its bound for the inside of the box."""
    return target > at if at == lower else target < at


@uncounted
def _solve(hessian, linear, x, state, factor, target):
    """The minimum over the free variables, the others where they are: ``target`` (n,), and whether there is one."""
    n = x.shape[0]
    for i in range(n):
        for j in range(i + 1):
            factor[i, j] = hessian[i, j] if state[i] == FREE and state[j] == FREE else 1.0 * (i == j)
        target[i] = x[i]
        if state[i] == FREE:
            target[i] = linear[i]
            for j in range(n):
                if state[j] != FREE:
                    target[i] -= hessian[i, j] * x[j]
    if not cholesky(factor):
        return False
    cholesky_solve(factor, target)
    return True


@uncounted
def _cut(target, lower, upper, x, state):
    """Cuts the target to the box, and says whether it was within."""
    inside = True
    for j in range(x.shape[0]):
        x[j] = min(max(target[j], lower[j]), upper[j])
        if x[j] != target[j]:
            state[j], inside = BOUND, False
    return inside


@uncounted
def _advance(target, lower, upper, x, state):
    """Goes to the target, or as far as the first bound, and says whether the target was reached."""
    share, first = 1.0, NONE
    for j in range(x.shape[0]):
        if state[j] == FREE and not lower[j] <= target[j] <= upper[j]:
            bound = lower[j] if target[j] < lower[j] else upper[j]
            way = (bound - x[j]) / (target[j] - x[j])
            if first == NONE or way < share:
                share, first = way, j
    for j in range(x.shape[0]):
        if state[j] == FREE:
            step = share * (target[j] - x[j])
            x[j] = target[j] if first == NONE else min(max(x[j] + step, lower[j]), upper[j])
    if first == NONE:
        return True
    x[first] = lower[first] if target[first] < lower[first] else upper[first]
    state[first] = BOUND
    return False


@uncounted
def _most_held_back(hessian, linear, lower, upper, x, state):
    """The variable whose release lowers the function the most, by its slope and curvature; NONE at the optimum."""
    found, most = NONE, 0.0
    for i in range(x.shape[0]):
        if state[i] != BOUND or lower[i] == upper[i]:
            continue
        slope, size = -linear[i], abs(linear[i])
        for j in range(x.shape[0]):
            slope += hessian[i, j] * x[j]
            size += abs(hessian[i, j] * x[j])
        leaving = slope < 0.0 if x[i] == lower[i] else slope > 0.0
        if leaving and abs(slope) > ROUNDING * size and slope * slope / hessian[i, i] > most:
            found, most = i, slope * slope / hessian[i, i]
    return found
