"""A helix in Cartesian space."""

from __future__ import annotations

import dataclasses
import typing

import numpy as np

from ikgym.arms import Arm
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import FloatArray, Positive, Signed, Vector


@dataclasses.dataclass(frozen=True, eq=False)
class Helix(Trajectory):
    """A helix about the z axis, without orientation (Zhang 2020, example 1).

    ``x = x_0 + r sin(ω τ), y = y_0 + r cos(ω τ), z = z_0 + c τ`` with ``τ = t + start``.

    Args:
        center: (x_0, y_0, z_0) in [m]. Shape (3,).
        radius: r in [m].
        frequency: ω in [rad/s].
        climb: c in [m/s].
        start: Time at which the helix is entered, in [s].

    Raises:
        InvalidInputError: A shape is wrong, or a number not finite or beyond 1e12.
    """

    center: Vector
    radius: Positive
    frequency: Signed
    climb: Signed
    start: Signed = 0.0
    has_orientation: typing.ClassVar[bool] = False

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """See :meth:`Trajectory.frames`."""
        del model
        tau = times + self.start
        angle = self.frequency * tau
        path = np.column_stack([self.radius * np.sin(angle), self.radius * np.cos(angle), self.climb * tau])
        path += self.center
        return path
