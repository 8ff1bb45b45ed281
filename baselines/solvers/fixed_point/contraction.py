"""Functions F(ξ) with an attractive fixed point, from which Dineva's iteration is made."""

from __future__ import annotations

import math
from typing import NamedTuple

from ikgym.exceptions import InvalidInputError
from ikgym.kernels.jit import kernel

#: The families by name, with their numbers in the kernel.
FAMILIES = {"affine": 0, "sigmoid": 1}


class Contraction(NamedTuple):
    """One function F: ℝ → ℝ with F(ξ*) = ξ* and |F'(ξ*)| < 1, made by :func:`contraction`.

    Attributes:
        family: Its family's number.
        slope: The factor in front, of an absolute value below 1.
        d: D, the shift.
        fixed_point: ξ*.
        derivative: F'(ξ*).
    """

    family: int
    slope: float
    d: float
    fixed_point: float
    derivative: float


def contraction(family: str, slope: float, d: float) -> Contraction:
    """A function of a family.

    Args:
        family: ``"affine"``: F(ξ) = slope · ξ + D (Faitli 2018, section 2.2, with the slope ½). Or ``"sigmoid"``:
            F(ξ) = artanh(slope · tanh(ξ + D)), which is bounded. That is a reconstruction of the "Sigmoid Generated
            Fixed Point Transformation" by Dineva, Tar, Várkonyi-Kóczy and Piuri (Faitli's reference 2), whose text
            is not at hand.
        slope: Not 0, of an absolute value below 1.
        d: D.

    Raises:
        InvalidInputError: The slope is 0.
    """
    if slope == 0.0:
        raise InvalidInputError("slope: expected a number between -1 and 1 other than 0, got 0.")
    if family == "affine":
        return Contraction(FAMILIES[family], slope, d, d / (1.0 - slope), slope)
    # With u = tanh ξ* and t = tanh D: t u² + (1 - slope) u - slope t = 0, in the form that does without dividing by t.
    t = math.tanh(d)
    u = 2.0 * slope * t / (1.0 - slope + math.sqrt((1.0 - slope) ** 2 + 4.0 * slope * t * t))
    # u = slope tanh(ξ* + D), and artanh' (u) = 1 / (1 - u²).
    inner = u / slope
    return Contraction(FAMILIES[family], slope, d, math.atanh(u), slope * (1.0 - inner * inner) / (1.0 - u * u))


@kernel
def evaluate(function, xi):
    """F(ξ) of a :class:`Contraction`."""
    if function.family == 0:
        return function.slope * xi + function.d
    return math.atanh(function.slope * math.tanh(xi + function.d))
