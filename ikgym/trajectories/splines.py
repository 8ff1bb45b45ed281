"""Cubic splines through points, and the arc length of a curve."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ikgym.validation import FloatArray, IntArray

# Gauss-Legendre rule for the length of a piece of a curve.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(7)
# Pieces that are looked at together: memory for long curves.
_TOGETHER = 2**8


@dataclasses.dataclass(frozen=True, eq=False)
class CubicSpline:
    """A twice continuously differentiable piecewise cubic curve, constant beyond its ends.

    Attributes:
        knots: Where the values are taken on, rising. Shape (k,), k >= 2.
        values: Shape (k, d).
        slopes: Derivatives at the knots. Shape (k, d).
    """

    knots: FloatArray
    values: FloatArray
    slopes: FloatArray

    @classmethod
    def through(cls, knots: FloatArray, values: FloatArray, *, at_rest: bool) -> CubicSpline:
        """The spline through values, with slope 0 at both ends (``at_rest``) or with curvature 0 there."""
        steps = np.diff(knots)
        secants = np.diff(values, axis=0) / steps[:, None]
        k = len(knots)
        lower, diagonal, upper, right = np.zeros(k), np.ones(k), np.zeros(k), np.zeros_like(values)
        lower[1:-1], upper[1:-1] = steps[1:], steps[:-1]
        diagonal[1:-1] = 2.0 * (steps[1:] + steps[:-1])
        right[1:-1] = 3.0 * (steps[1:, None] * secants[:-1] + steps[:-1, None] * secants[1:])
        if not at_rest:
            diagonal[[0, -1]], upper[0], lower[-1] = 2.0, 1.0, 1.0
            right[[0, -1]] = 3.0 * secants[[0, -1]]
        return cls(knots, values, _solve_tridiagonal(lower, diagonal, upper, right))

    def __call__(self, at: FloatArray, derivative: int = 0) -> FloatArray:
        """The curve, or its first or second derivative. ``at``: shape (...,). Returns shape (..., d)."""
        inside = np.clip(at, self.knots[0], self.knots[-1])
        i = np.clip(np.searchsorted(self.knots, inside, side="right") - 1, 0, len(self.knots) - 2)
        return self.along_pieces(i, (inside - self.knots[i]) / (self.knots[i + 1] - self.knots[i]), derivative)

    def along_pieces(self, i: IntArray, u: FloatArray, derivative: int = 0) -> FloatArray:
        """The same at shares u of the way from knot i to the next. Shapes that broadcast to (...,), and (..., d)."""
        h, u = (self.knots[i + 1] - self.knots[i])[..., None], u[..., None]
        secant = (self.values[i + 1] - self.values[i]) / h
        a, b = self.slopes[i], self.slopes[i + 1]
        c, d = 3.0 * secant - 2.0 * a - b, a + b - 2.0 * secant
        if derivative == 2:
            return (2.0 * c + 6.0 * u * d) / h
        if derivative == 1:
            return a + u * (2.0 * c + 3.0 * u * d)
        out: FloatArray = self.values[i] + h * u * (a + u * (c + u * d))
        return out

    def extremes(self, samples: int) -> tuple[float, int, float]:
        """The least speed by the parameter, the piece where it occurs, and the largest curvature of a curve in space.

        Args:
            samples: Stretches of a piece at whose ends the curve is looked at.
        """
        least, slowest, largest, u = math.inf, 0, 0.0, np.arange(samples + 1) / samples
        for start in range(0, len(self.knots) - 1, _TOGETHER):
            pieces = np.arange(start, min(start + _TOGETHER, len(self.knots) - 1))[:, None]
            first, second = (self.along_pieces(pieces, u, derivative) for derivative in (1, 2))
            speed, bend = (np.linalg.norm(vectors, axis=-1) for vectors in (first, np.cross(first, second)))
            if speed.min() < least:
                least, slowest = float(speed.min()), start + int(speed.argmin()) // (samples + 1)
            moving = speed > 0.0
            largest = max(largest, float((bend[moving] / (speed * speed * speed)[moving]).max(initial=0.0)))
        return least, slowest, largest


def _solve_tridiagonal(lower: FloatArray, diagonal: FloatArray, upper: FloatArray, right: FloatArray) -> FloatArray:
    """Solves a diagonally dominant tridiagonal system, without pivots. Shapes (k,) and (k, d)."""
    left, middle, columns, k = lower.tolist(), diagonal.tolist(), right.T.tolist(), len(right)
    for i in range(1, k):
        factor = left[i] / middle[i - 1]
        middle[i] -= factor * upper[i - 1]
        for column in columns:
            column[i] -= factor * column[i - 1]
    factors = (upper[:-1] / middle[1:]).tolist()
    for column in columns:
        for i in range(k - 2, -1, -1):
            column[i] -= factors[i] * column[i + 1]
    solution: FloatArray = np.array(columns).T / np.array(middle)[:, None]
    return solution


class ArcLength:
    """The length of a curve as a function of its parameter, and the other way round.

    Args:
        speed: The length of the curve's derivative at parameters of any shape.
        breaks: Parameters between which the curve is smooth, and the speed varies little. Shape (b,).
    """

    def __init__(self, speed: Callable[[FloatArray], FloatArray], breaks: FloatArray) -> None:
        self._speed, self._breaks = speed, breaks
        starts = range(0, len(breaks) - 1, _TOGETHER)
        parts = [breaks[i : i + _TOGETHER + 1] for i in starts]
        pieces = [self._integrate(part[:-1], part[1:]) for part in parts]
        self.lengths: FloatArray = np.concatenate([[0.0], np.cumsum(np.concatenate(pieces))])

    def parameter(self, s: FloatArray) -> FloatArray:
        """Parameter of the curve at the arc length ``s``. Shape (k,)."""
        i = np.clip(np.searchsorted(self.lengths, s, side="right") - 1, 0, len(self._breaks) - 2)
        first, last = self._breaks[i], self._breaks[i + 1]
        share = (s - self.lengths[i]) / (self.lengths[i + 1] - self.lengths[i])
        u = np.clip(first + share * (last - first), first, last)
        for _ in range(4):  # Newton's method, whose error is squared each time
            excess = self.lengths[i] + self._integrate(first, u) - s
            u = np.clip(u - excess / self._speed(u), first, last)
        return u

    def _integrate(self, first: FloatArray, last: FloatArray) -> npt.NDArray[np.float64]:
        half = 0.5 * (last - first)
        at = 0.5 * (first + last)[:, None] + half[:, None] * _NODES
        return half * (self._speed(at) @ _WEIGHTS)
