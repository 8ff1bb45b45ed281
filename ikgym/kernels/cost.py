"""Kernels of the tracking cost: value, gradient and curvature of Φ^X and Φ^U (Varga 2021, section III)."""

from __future__ import annotations

from typing import NamedTuple

from ikgym.kernels.jit import inlined, kernel


class CostParameters(NamedTuple):
    """The shape of the cost; see :class:`ikgym.TrackingCost`."""

    delta_x: float
    p_x: float
    delta_qdot: float
    p_out: float
    p_in: float


#: Which costs these kernels calculate: raised by whoever changes a value that they give. Best known costs and test
#: sets belong to one version, and are refused or set aside under another.
COST_VERSION = 1

# The exponent of small tracking errors is not a parameter: "the usual quadratic tracking rule".
P_X_INSIDE = 2.0


@inlined
def _power(x, p):
    """The p-th power of x >= 0; whole exponents, the usual case, cost a few products instead of a call."""
    if p == 2.0:
        return x * x
    if p == 3.0:
        return x * x * x
    if p == 4.0:
        return (x * x) * (x * x)
    if p == 1.0:
        return x
    if p == 0.0:
        return 1.0
    return x**p


@inlined
def value(x, delta, inside, outside):
    """|x / Δ| to the power ``inside`` up to |x| = Δ and ``outside`` beyond: one component of a cost."""
    r = abs(x) / delta
    return _power(r, outside if r > 1.0 else inside)


@inlined
def gradient(x, delta, inside, outside):
    """Derivative of :func:`value` with respect to x."""
    r = abs(x) / delta
    p = outside if r > 1.0 else inside
    size = p * _power(r, p - 1.0) / delta
    # At rest the cost is flat, also for p = 1, where any gradient between -1/Δ and 1/Δ is right.
    return size if x > 0.0 else (-size if x < 0.0 else 0.0)


@inlined
def curvature(x, delta, inside, outside):
    """Second derivative of :func:`value` with respect to x."""
    r = abs(x) / delta
    p = outside if r > 1.0 else inside
    if p == 1.0:
        return 0.0
    return p * (p - 1.0) * _power(r, p - 2.0) / delta / delta


@kernel
def tracking(cost, error):
    """Φ^X, the sum over the components of the tracking error. Shape of ``error`` (e,)."""
    total = 0.0
    for j in range(error.shape[0]):
        total += value(error[j], cost.delta_x, P_X_INSIDE, cost.p_x)
    return total


@kernel
def tracking_gradient(cost, error, out):
    """∂Φ^X/∂error. Shapes (e,)."""
    for j in range(error.shape[0]):
        out[j] = gradient(error[j], cost.delta_x, P_X_INSIDE, cost.p_x)


@kernel
def tracking_curvature(cost, error, out):
    """The diagonal of ∂²Φ^X/∂error². Shapes (e,)."""
    for j in range(error.shape[0]):
        out[j] = curvature(error[j], cost.delta_x, P_X_INSIDE, cost.p_x)


@kernel
def velocity(cost, qdot):
    """Φ^U, the sum over all joints (the printed sum to 6 is a misprint). Shape of ``qdot`` (n,)."""
    total = 0.0
    for j in range(qdot.shape[0]):
        total += value(qdot[j], cost.delta_qdot, cost.p_in, cost.p_out)
    return total


@kernel
def velocity_gradient(cost, qdot, out):
    """∂Φ^U/∂q̇. Shapes (n,)."""
    for j in range(qdot.shape[0]):
        out[j] = gradient(qdot[j], cost.delta_qdot, cost.p_in, cost.p_out)


@kernel
def velocity_curvature(cost, qdot, out):
    """The diagonal of ∂²Φ^U/∂q̇². Shapes (n,)."""
    for j in range(qdot.shape[0]):
        out[j] = curvature(qdot[j], cost.delta_qdot, cost.p_in, cost.p_out)


class ProximityParameters(NamedTuple):
    """The shape of the cost; see :class:`ikgym.ProximityCost`."""

    clearance: float
    delta: float
    p_out: float
    p_in: float


#: No cost at any distance.
NO_PROXIMITY = ProximityParameters(0.0, 1.0, 1.0, 1.0)


@inlined
def proximity(cost, distance):
    """Φ^C of the smallest signed distance in [m]; bodies that overlap count as bodies that touch."""
    return value(max(cost.clearance - max(distance, 0.0), 0.0), cost.delta, cost.p_in, cost.p_out)
