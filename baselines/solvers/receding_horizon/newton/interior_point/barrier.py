"""Kernels: a smooth stand-in for a cost that grows only beyond a bound.

A kink of the cost is w max(0, u), and a limit u <= 0 the same with a w above its multiplier (an exact penalty, so that
no path is infeasible). Both are the least w t over t >= 0 and t >= u, and with a logarithmic barrier for these two
conditions a smooth function of u: φ(u) = min_t w t - μ log t - μ log (t - u), which tends to w max(0, u) with μ.
Newton's method with the exact φ'' goes wrong from far; the curvature is taken from the primal-dual equations
λ (t - u) = μ and (w - λ) t = μ with a multiplier λ of its own (Nocedal and Wright, *Numerical optimization*, 2006,
section 19.3).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ikgym.kernels.jit import inlined

# A multiplier stays within this factor of what the barrier's gradient says (Wächter and Biegler 2006, eq. 16).
TRUSTED = 1e4


class Smoothed(NamedTuple):
    """φ at one place.

    Attributes:
        value: φ.
        gradient: φ', which lies between 0 and w.
        above: 2 w t.
        room: 2 w (t - u).
    """

    value: float
    gradient: float
    above: float
    room: float


@inlined
def smoothed(u, weight, mu):
    """φ(u) for a weight w and a barrier parameter μ > 0; gives a :class:`Smoothed`."""
    scaled, two = weight * u, 2.0 * mu
    root = math.sqrt(scaled * scaled + two * two)
    # The smaller of root ± scaled by the product of the two, without cancellation.
    if scaled > 0.0:
        above = two + (root + scaled)
        room = two + two * two / (root + scaled)
    else:
        above = two + two * two / (root - scaled)
        room = two + (root - scaled)
    value = 0.5 * above - mu * math.log(above * room / (two * two))
    return Smoothed(value, weight * two / room, above, room)


@inlined
def primal_dual_curvature(here, weight, multiplier):
    """What the primal-dual equations take for φ'', with the λ given."""
    by_room = 2.0 * weight * multiplier / here.room
    by_above = 2.0 * weight * (weight - multiplier) / here.above
    return by_room * by_above / (by_room + by_above)


@inlined
def trusted(multiplier, here, weight):
    """The λ nearest to the one given for which λ and w - λ are not far from what φ' says."""
    rest = weight - here.gradient
    low = max(here.gradient / TRUSTED, weight - TRUSTED * rest)
    high = min(TRUSTED * here.gradient, weight - rest / TRUSTED)
    return min(max(multiplier, low), high)
