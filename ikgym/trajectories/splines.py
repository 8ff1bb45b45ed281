"""Cubic splines through points, and the arc length of a curve."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ikgym.kernels.cubic_splines import solve_tridiagonal
from ikgym.validation import FloatArray

# Gauss-Legendre rule for the length of a piece of a curve.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(7)
# Pieces whose lengths are computed at a time: memory for long curves.
_TOGETHER = 2**11


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
        solve_tridiagonal(lower, diagonal, upper, right)
        return cls(knots, values, right)

    def __call__(self, at: FloatArray, derivative: int = 0) -> FloatArray:
        """The curve, or its first or second derivative. ``at``: shape (...,). Returns shape (..., d)."""
        inside = np.clip(at, self.knots[0], self.knots[-1])
        i = np.clip(np.searchsorted(self.knots, inside, side="right") - 1, 0, len(self.knots) - 2)
        h = (self.knots[i + 1] - self.knots[i])[..., None]
        u = (inside - self.knots[i])[..., None] / h
        secant = (self.values[i + 1] - self.values[i]) / h
        a, b = self.slopes[i], self.slopes[i + 1]
        c, d = 3.0 * secant - 2.0 * a - b, a + b - 2.0 * secant
        if derivative == 2:
            return (2.0 * c + 6.0 * u * d) / h
        if derivative == 1:
            return a + u * (2.0 * c + 3.0 * u * d)
        out: FloatArray = self.values[i] + h * u * (a + u * (c + u * d))
        return out


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
