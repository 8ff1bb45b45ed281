"""Kernel: the cost of bodies that come near to each other or to obstacles."""

from typing import NamedTuple

from ikgym.kernels.cost import value
from ikgym.kernels.jit import inlined


class ProximityParameters(NamedTuple):
    """The shape of the cost; see :class:`ikgym.ProximityCost`."""

    clearance: float
    delta: float
    p_out: float
    p_in: float


#: No cost at any distance.
OFF = ProximityParameters(0.0, 1.0, 1.0, 1.0)


@inlined
def proximity(cost, distance):
    """Φ^C of the smallest signed distance in [m]; bodies that overlap count as bodies that touch."""
    return value(max(cost.clearance - max(distance, 0.0), 0.0), cost.delta, cost.p_in, cost.p_out)
