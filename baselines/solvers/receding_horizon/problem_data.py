"""What the kernels of a receding horizon are told of a problem; the same at all grid points and in all periods."""

from __future__ import annotations

from typing import NamedTuple

import numpy.typing as npt
from numpy import float64

from ikgym.kernels.cost import CostParameters
from ikgym.kernels.kinematics import Chain


class ProblemData(NamedTuple):
    """Arm, task, cost and limits.

    Attributes:
        chain: The model of the arm.
        kind: The kind of task coordinates, see :mod:`ikgym.kernels.tasks`.
        cost: The cost's parameters.
        dt: Δt in [s].
        lower: Least joint coordinates in [rad] or [m], -inf where there is no limit. Shape (n,).
        upper: Largest joint coordinates in [rad] or [m], inf where there is no limit. Shape (n,).
        velocity_limit: Largest joint velocities in [rad/s] or [m/s]. Shape (n,).
    """

    chain: Chain
    kind: int
    cost: CostParameters
    dt: float
    lower: npt.NDArray[float64]
    upper: npt.NDArray[float64]
    velocity_limit: npt.NDArray[float64]
