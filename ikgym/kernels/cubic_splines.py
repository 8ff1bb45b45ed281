"""Kernels of cubic splines, linear in the number of knots."""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels.jit import kernel


@kernel
def solve_tridiagonal(lower, diagonal, upper, right):
    """Solves a diagonally dominant tridiagonal system in place.

    Args:
        lower: Entries left of the diagonal; the first has no meaning. Shape (k,).
        diagonal: Changed. Shape (k,).
        upper: Entries right of the diagonal; the last has no meaning. Shape (k,).
        right: Becomes the solution. Shape (k, d).
    """
    k, d = right.shape
    for i in range(1, k):
        factor = lower[i] / diagonal[i - 1]
        diagonal[i] -= factor * upper[i - 1]
        for j in range(d):
            right[i, j] -= factor * right[i - 1, j]
    for i in range(k - 2, -1, -1):
        for j in range(d):
            right[i, j] -= upper[i] / diagonal[i + 1] * right[i + 1, j]
    for i in range(k):
        for j in range(d):
            right[i, j] /= diagonal[i]


@kernel
def extremes(knots, values, slopes, samples):
    """The least speed and the largest curvature of a cubic spline in space.

    Args:
        knots: Shape (k,).
        values: Shape (k, 3).
        slopes: Derivatives at the knots. Shape (k, 3).
        samples: Points between two knots that are looked at.

    Returns:
        The least speed by the parameter, the index of the interval where it occurs, and the largest curvature.
    """
    least, slowest, largest = math.inf, 0, 0.0
    first, second = np.empty(3), np.empty(3)
    for i in range(len(knots) - 1):
        h = knots[i + 1] - knots[i]
        for sample in range(samples + 1):
            u = sample / samples
            for j in range(3):
                secant = (values[i + 1, j] - values[i, j]) / h
                a, b = slopes[i, j], slopes[i + 1, j]
                c, d = 3.0 * secant - 2.0 * a - b, a + b - 2.0 * secant
                first[j] = a + u * (2.0 * c + 3.0 * u * d)
                second[j] = (2.0 * c + 6.0 * u * d) / h
            speed = math.sqrt(first[0] * first[0] + first[1] * first[1] + first[2] * first[2])
            if speed < least:
                least, slowest = speed, i
            x = first[1] * second[2] - first[2] * second[1]
            y = first[2] * second[0] - first[0] * second[2]
            z = first[0] * second[1] - first[1] * second[0]
            if speed > 0.0:
                largest = max(largest, math.sqrt(x * x + y * y + z * z) / speed**3)
    return least, slowest, largest
