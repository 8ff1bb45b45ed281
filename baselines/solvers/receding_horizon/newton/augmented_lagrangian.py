"""Kernel: the augmented-Lagrangian term of a cost that grows only beyond a bound.

The cost has kinks: beyond |e| = Δx the derivative of Φ^X jumps from 2 to P_X. A minimum often lies right on such a
kink, where no gradient vanishes. The part beyond the kink, max(0, |x| - 1), is the largest of λ x - |λ| over |λ| <= 1;
held near the λ known from the step before, which is the method of multipliers, it is smooth, and Newton's method finds
the minimum exactly. A joint limit is the same with a λ without bound.
"""

from __future__ import annotations

from typing import NamedTuple

from ikgym.kernels.jit import inlined


class AugmentedTerm(NamedTuple):
    """An augmented-Lagrangian term at one place.

    Attributes:
        value: Its value.
        multiplier: λ, the multiplier brought up to date, which is also the term's derivative.
        curvature: Its second derivative.
        linear: λ (x - bound) alone.
    """

    value: float
    multiplier: float
    curvature: float
    linear: float


@inlined
def augmented_term(x, low, high, multiplier, penalty, largest):
    """The largest of λ (x - bound) - (λ - λ₀)² / (2 ρ) over |λ| <= largest; λ > 0 at ``high``, λ < 0 at ``low``.

    Args:
        x: Where.
        low: The lower bound, below which the term grows.
        high: The upper bound, above which it grows.
        multiplier: λ₀, the multiplier so far.
        penalty: ρ.
        largest: The largest |λ|: the steepness of a kink, infinite for a limit.

    Returns:
        An :class:`AugmentedTerm`.
    """
    beyond = x - high
    updated = multiplier + penalty * beyond
    if updated <= 0.0:
        beyond = x - low
        updated = multiplier + penalty * beyond
        if updated >= 0.0:
            return AugmentedTerm(-0.5 * multiplier * multiplier / penalty, 0.0, 0.0, 0.0)
    curvature = penalty
    if abs(updated) >= largest:
        updated = largest if updated > 0.0 else -largest
        curvature = 0.0
    change = updated - multiplier
    return AugmentedTerm(updated * beyond - 0.5 * change * change / penalty, updated, curvature, updated * beyond)
