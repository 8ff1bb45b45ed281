"""Kernels: the smooth terms in place of kinks and limits of the cost, one component at a time.

The cost has kinks: beyond |e| = Δx the derivative of Φ^X jumps from 2 to P_X. A minimum often lies right on such a
kink, where no gradient vanishes. There are two ways to make it smooth.

**Augmented Lagrangian.** The part beyond the kink, max(0, |x| - 1), is the largest of λ x - |λ| over |λ| <= 1. Held
near the λ known from the step before, which is the method of multipliers, it is smooth, and Newton's method finds the
minimum exactly. A joint limit has a λ without bound.

**Barrier.** A kink of the cost is w max(0, u), and a limit u <= 0 the same with a w above its multiplier (an exact
penalty, so that no path is infeasible). Both are the least w t over t >= 0 and t >= u, and with a logarithmic barrier
for these two conditions a smooth function of u: φ(u) = min_t w t - μ log t - μ log (t - u), which tends to w max(0, u)
with μ. Newton's method with the exact φ'' goes wrong from far; the curvature is taken from the primal-dual equations λ
(t - u) = μ and (w - λ) t = μ with a separate multiplier λ (Nocedal and Wright, *Numerical optimization*, 2006,
section 19.3).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ikgym.kernels import cost as cost_kernels
from ikgym.kernels.cost import P_X_INSIDE
from ikgym.kernels.jit import inlined
from ikgym.kernels.limits import FASTEST, LOWER, UPPER

# ρ of a kink, in units of its steepness over Δ: the larger, the fewer updates of λ and the harder for Newton.
KINK_PENALTY = 100.0
# ρ of a limit of the velocities, in units of the curvature of Φ^U there, and of one of the joints, in units of that of
# Φ^X at rest. Tracking acts on a limit with the curvature that errors of many Δx have: with a lower ρ the multipliers
# do not get there in time.
VELOCITY_PENALTY = 300.0
JOINT_PENALTY = 1e4
# Velocities below this share of Δq̇ count as this share in the curvature of Φ^U, which vanishes at rest.
LEAST_SPEED = 1e-3
# A multiplier stays within this factor of the barrier's gradient (Wächter and Biegler 2006, eq. 16).
TRUSTED = 1e4


# The memory of a barrier: λ; and φ', the value used for φ'', and u at the path before.
MULTIPLIER, GRADIENT, CURVATURE, BEYOND = range(4)
BARRIER_SIZE = 4


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


class TrackingTerm(NamedTuple):
    """One component of Φ^X with its kink held by a multiplier.

    Attributes:
        value: Its value.
        gradient: Its derivative by the error.
        curvature: Its second derivative by the error.
        multiplier: λ, brought up to date.
        gap: The true cost of the kink less the one by its multiplier.
    """

    value: float
    gradient: float
    curvature: float
    multiplier: float
    gap: float


@inlined
def tracking_term(cost, error, multiplier):
    """One component of Φ^X, of an error in [m] or [rad], with its kink held; gives a :class:`TrackingTerm`."""
    value = cost_kernels.value(error, cost.delta_x, P_X_INSIDE, cost.p_x)
    gradient = cost_kernels.gradient(error, cost.delta_x, P_X_INSIDE, cost.p_x)
    curvature = cost_kernels.curvature(error, cost.delta_x, P_X_INSIDE, cost.p_x)
    steepness = cost.p_x - P_X_INSIDE
    if steepness <= 0.0:
        return TrackingTerm(value, gradient, curvature, 0.0, 0.0)
    x = error / cost.delta_x
    beyond = abs(x) - 1.0
    if beyond > 0.0:
        # The part beyond the kink is taken out, and comes back smooth.
        value -= steepness * beyond
        gradient -= math.copysign(steepness / cost.delta_x, x)
    kink = augmented_term(x, -1.0, 1.0, multiplier, KINK_PENALTY, 1.0)
    return TrackingTerm(
        value + steepness * kink.value,
        gradient + steepness * kink.multiplier / cost.delta_x,
        curvature + steepness * kink.curvature / (cost.delta_x * cost.delta_x),
        kink.multiplier,
        steepness * (max(beyond, 0.0) - kink.linear),
    )


@inlined
def velocity_cost(cost, velocity):
    """Φ^U of one joint velocity in [rad/s] or [m/s]."""
    return cost_kernels.value(velocity, cost.delta_qdot, cost.p_in, cost.p_out)


@inlined
def velocity_derivatives(cost, velocity):
    """The first and second derivative of :func:`velocity_cost`; the second not less than at a small velocity."""
    speed = max(abs(velocity), LEAST_SPEED * cost.delta_qdot)
    return (
        cost_kernels.gradient(velocity, cost.delta_qdot, cost.p_in, cost.p_out),
        cost_kernels.curvature(speed, cost.delta_qdot, cost.p_in, cost.p_out),
    )


@inlined
def velocity_limit_term(data, j, velocity, multiplier, penalty_factor):
    """The term of the velocity limit of joint ``j``, in [rad/s] or [m/s]; gives an ``AugmentedTerm``."""
    limit, cost = data.limits[FASTEST, j], data.cost
    penalty = (
        penalty_factor
        * VELOCITY_PENALTY
        * cost_kernels.curvature(limit, cost.delta_qdot, cost.p_in, max(cost.p_out, 2.0))
    )
    return augmented_term(velocity, -limit, limit, multiplier, penalty, math.inf)


@inlined
def joint_limit_term(data, j, q, multiplier, penalty_factor):
    """The term of the limits of joint ``j``, in [rad] or [m]; gives an ``AugmentedTerm``."""
    penalty = penalty_factor * JOINT_PENALTY * 2.0 / (data.cost.delta_x * data.cost.delta_x)
    return augmented_term(q, data.limits[LOWER, j], data.limits[UPPER, j], multiplier, penalty, math.inf)


@inlined
def kink_steepness(cost):
    """By how much the derivative of Φ^X jumps at its kink, in units of Δx; 0 where it falls."""
    return max(cost.p_x - P_X_INSIDE, 0.0)


@inlined
def without_kink(cost, error, steepness):
    """A component of Φ^X without the part beyond its kink."""
    value = cost_kernels.value(error, cost.delta_x, P_X_INSIDE, cost.p_x)
    return value - steepness * max(abs(error) / cost.delta_x - 1.0, 0.0)


@inlined
def derivatives_without_kink(cost, error, steepness):
    """The first and second derivative of :func:`without_kink`."""
    gradient = cost_kernels.gradient(error, cost.delta_x, P_X_INSIDE, cost.p_x)
    if abs(error) > cost.delta_x:
        gradient -= math.copysign(steepness / cost.delta_x, error)
    return gradient, cost_kernels.curvature(error, cost.delta_x, P_X_INSIDE, cost.p_x)


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
def smooth(u, weight, mu):
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
    """Approximation of φ'' in the primal-dual equations, for given λ."""
    by_room = 2.0 * weight * multiplier / here.room
    by_above = 2.0 * weight * (weight - multiplier) / here.above
    return by_room * by_above / (by_room + by_above)


@inlined
def clip_multiplier(multiplier, here, weight):
    """The λ nearest to the one given for which λ and w - λ are not far from φ'."""
    rest = weight - here.gradient
    low = max(here.gradient / TRUSTED, weight - TRUSTED * rest)
    high = min(TRUSTED * here.gradient, weight - rest / TRUSTED)
    return min(max(multiplier, low), high)


class Bounded(NamedTuple):
    """A quantity between two bounds.

    Attributes:
        value: φ of both bounds.
        gradient: Its derivative.
        curvature: Its second derivative, as Newton's method is to take it.
    """

    value: float
    gradient: float
    curvature: float


@inlined
def one_side(barriers, k, i, side, u, weight, mu, advance):
    """One bound; gives a :class:`Bounded`. λ follows from the primal-dual equations of this step."""
    here = smooth(u, weight, mu)
    multiplier = here.gradient
    if advance >= 0.0:
        multiplier = barriers[k, i, side, MULTIPLIER]
        if advance > 0.0:
            missing = barriers[k, i, side, GRADIENT] - multiplier
            moved = u - barriers[k, i, side, BEYOND]
            multiplier += advance * missing + barriers[k, i, side, CURVATURE] * moved
        multiplier = clip_multiplier(multiplier, here, weight)
    curvature = primal_dual_curvature(here, weight, multiplier)
    barriers[k, i, side, MULTIPLIER] = multiplier
    barriers[k, i, side, GRADIENT] = here.gradient
    barriers[k, i, side, CURVATURE] = curvature
    barriers[k, i, side, BEYOND] = u
    return Bounded(here.value, here.gradient, curvature)
