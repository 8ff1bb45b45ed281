"""Kernels: the terms of the merit function, one component at a time, each with its derivatives.

The merit function is the cost of a path with its kinks and limits replaced by augmented-Lagrangian terms.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from baselines.solvers.receding_horizon.newton.augmented_lagrangian import augmented_term
from ikgym.kernels import cost as cost_kernels
from ikgym.kernels.cost import P_X_INSIDE
from ikgym.kernels.jit import inlined

# ρ of a kink, in units of its steepness over Δ: the larger, the fewer updates of λ and the harder for Newton.
KINK_PENALTY = 100.0
# ρ of a limit of the velocities, in units of the curvature of Φ^U there, and of one of the joints, in units of that of
# Φ^X at rest. Tracking acts on a limit with the curvature that errors of many Δx have: with a lower ρ the multipliers
# do not get there in time.
VELOCITY_PENALTY = 300.0
JOINT_PENALTY = 1e4
# Velocities below this share of Δq̇ count as this share in the curvature of Φ^U, which vanishes at rest.
LEAST_SPEED = 1e-3


class TrackingTerm(NamedTuple):
    """One component of Φ^X with its kink held by a multiplier.

    Attributes:
        value: Its value.
        gradient: Its derivative by the error.
        curvature: Its second derivative by the error.
        multiplier: λ, brought up to date.
        gap: The true cost of the kink less what its multiplier says.
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
    limit, cost = data.velocity_limit[j], data.cost
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
    return augmented_term(q, data.lower[j], data.upper[j], multiplier, penalty, math.inf)
