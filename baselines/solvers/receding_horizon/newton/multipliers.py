"""Kernels: terms of a cost that press only beyond a bound, with their multipliers.

The cost has kinks: beyond |e| = Δx the slope of Φ^X jumps from 2 to P_X. A minimum often lies right on such a kink,
where no gradient vanishes. The part beyond the kink, max(0, |x| - 1), is the largest of λ x - |λ| over |λ| <= 1; held
near the λ known from the step before, which is the method of multipliers, it is smooth, and Newton's method finds the
minimum exactly. A joint limit is the same with a λ without bound.
"""

from __future__ import annotations

from ikgym.jit import inlined


@inlined
def press(x, low, high, multiplier, stiffness, most):
    """The largest of λ (x - bound) - (λ - λ₀)² / (2 ρ) over |λ| <= most; λ > 0 at ``high``, λ < 0 at ``low``.

    Args:
        x: Where.
        low: Where the term begins to press from below.
        high: Where it begins to press from above.
        multiplier: λ₀.
        stiffness: ρ.
        most: The largest |λ|: the steepness of a kink, infinite for a limit.

    Returns:
        Its value, its slope λ, its curvature, and λ (x - bound) alone.
    """
    beyond = x - high
    pressure = multiplier + stiffness * beyond
    if pressure <= 0.0:
        beyond = x - low
        pressure = multiplier + stiffness * beyond
        if pressure >= 0.0:
            return -0.5 * multiplier * multiplier / stiffness, 0.0, 0.0, 0.0
    curvature = stiffness
    if abs(pressure) >= most:
        pressure = most if pressure > 0.0 else -most
        curvature = 0.0
    change = pressure - multiplier
    return pressure * beyond - 0.5 * change * change / stiffness, pressure, curvature, pressure * beyond
