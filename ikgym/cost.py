"""The tracking cost, the score of every policy, and the cost of proximity, which a scenario may add."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Annotated

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.kernels import cost as cost_kernels
from ikgym.kernels.cost import CostParameters, ProximityParameters, proximity
from ikgym.validation import Bounds, FloatArray, Positive, float_array

#: The exponents of the cost do not exceed it.
LARGEST_EXPONENT = 100.0
Exponent = Annotated[float, Bounds(at_least=1.0, at_most=LARGEST_EXPONENT)]


@dataclasses.dataclass(frozen=True)
class TrackingCost(Frozen):
    """The stage cost of a receding-horizon controller (Varga 2021, section III).

    Per component j, ``Φ^X_j = |e_j / Δx|^P`` with P = 2 inside ``|e_j| <= Δx`` and ``P_X`` outside, and
    ``Φ^U_j = |q̇_j / Δq̇|^P`` with ``P_in`` inside ``|q̇_j| <= Δq̇`` and ``P_out`` outside. Both are continuous;
    their gradients jump where the exponent changes. Small errors and small velocities are nearly free, large ones
    are very costly.

    Args:
        delta_x: Δx, the tracking error that counts as 1, in [m] and [rad] (or as a number, for parts of a
            rotation matrix). From 1e-12 to 1e12.
        p_x: P_X, the exponent of errors above Δx. From 1 to 100.
        delta_qdot: Δq̇, the joint velocity that counts as 1, in [rad/s] or [m/s]. From 1e-12 to 1e12.
        p_out: The exponent of velocities above Δq̇. From 1 to 100.
        p_in: The exponent of velocities up to Δq̇. From 1 to 100.

    A scenario also refuses costs that may grow too large within an episode.

    Raises:
        InvalidInputError: A parameter is not within its bounds.
    """

    delta_x: Positive = 1e-3
    p_x: Exponent = 3.0
    delta_qdot: Positive = 0.8
    p_out: Exponent = 4.0
    p_in: Exponent = 4.0

    @property
    def parameters(self) -> CostParameters:
        """The cost as its kernels see it."""
        return CostParameters(self.delta_x, self.p_x, self.delta_qdot, self.p_out, self.p_in)

    def largest(self, errors: FloatArray, velocities: FloatArray) -> float:
        """The largest cost of a step, Φ^X + Φ^U; infinite where it exceeds all floats.

        Args:
            errors: Largest absolute components of the error. Shape (e,).
            velocities: Largest joint velocities in [rad/s] or [m/s]. Shape (n,).
        """
        x, u = errors / self.delta_x, velocities / self.delta_qdot
        with np.errstate(over="ignore", under="ignore"):
            tracking = np.where(x > 1.0, x**self.p_x, x**cost_kernels.P_X_INSIDE).sum()
            velocity = np.where(u > 1.0, u**self.p_out, u**self.p_in).sum()
        return float(tracking + velocity)

    def tracking(self, error: npt.ArrayLike) -> FloatArray | float:
        """Φ^X of a tracking error.

        Args:
            error: Error of the task coordinates. Shape (..., e).

        Returns:
            The cost, a float for one error. Shape (...).

        Raises:
            InvalidInputError: The error is no array of finite numbers.
        """
        return self._sum("error", error, cost_kernels.tracking)

    def velocity(self, qdot: npt.ArrayLike) -> FloatArray | float:
        """Φ^U of a joint velocity.

        Args:
            qdot: Joint velocity in [rad/s] or [m/s]. Shape (..., n).

        Returns:
            The cost, a float for one velocity. Shape (...).

        Raises:
            InvalidInputError: The velocity is no array of finite numbers.
        """
        return self._sum("qdot", qdot, cost_kernels.velocity)

    def _sum(self, name: str, value: npt.ArrayLike, kernel: Callable[..., float]) -> FloatArray | float:
        array = float_array(name, value)
        if array.ndim == 0 or array.shape[-1] == 0:
            raise InvalidInputError(f"{name}: expected shape (..., components), got {array.shape}.")
        out = np.array([kernel(self.parameters, row) for row in array.reshape(-1, array.shape[-1])])
        return float(out[0]) if array.ndim == 1 else out.reshape(array.shape[:-1])


@dataclasses.dataclass(frozen=True)
class ProximityCost(Frozen):
    """The cost of bodies that come near to each other or to obstacles, which joins the stage cost of a scenario.

    With the smallest signed distance d of a step and the depth s = ``clearance`` − max(d, 0), ``Φ^C = (s / Δ)^P`` with
    ``P_in`` inside ``s <= Δ`` and ``P_out`` outside; 0 where nothing is nearer than ``clearance``. Bodies that overlap
    count as bodies that touch.

    It is a part of the score. Solvers do not know it: those that minimise a stage cost, such as `rhc`, minimise Φ^X +
    Φ^U, and keep a distance of their choice from bodies. There is no best known cost with it.

    Args:
        clearance: The distance below which it costs anything, in [m]. From 1e-12 to 1e12.
        delta: Δ, the depth that counts as 1, in [m]. From 1e-12 to 1e12.
        p_out: The exponent of depths above Δ. From 1 to 100.
        p_in: The exponent of depths up to Δ. From 1 to 100.

    Raises:
        InvalidInputError: A parameter is not within its bounds.
    """

    clearance: Positive
    delta: Positive = 1e-2
    p_out: Exponent = 3.0
    p_in: Exponent = 2.0

    @property
    def parameters(self) -> ProximityParameters:
        """The cost as its kernel sees it."""
        return ProximityParameters(self.clearance, self.delta, self.p_out, self.p_in)

    @property
    def largest(self) -> float:
        """The cost of bodies that touch; infinite where it exceeds all floats."""
        depth = np.float64(self.clearance / self.delta)
        with np.errstate(over="ignore"):
            return float(depth ** (self.p_out if depth > 1.0 else self.p_in))

    def value(self, distance: npt.ArrayLike) -> FloatArray | float:
        """Φ^C of the smallest signed distance.

        Args:
            distance: In [m]. Shape (...).

        Returns:
            The cost, a float for one distance. Shape (...).

        Raises:
            InvalidInputError: The distance is no array of finite numbers.
        """
        array = float_array("distance", distance)
        out = np.array([proximity(self.parameters, one) for one in array.ravel().tolist()])
        return float(out[0]) if array.ndim == 0 else out.reshape(array.shape)
