"""Guards of a control loop: implausible measurements and errors of the path stop the arm."""

from __future__ import annotations

import dataclasses
import enum
from typing import Annotated

import numpy as np

from baselines.controller import kernels
from baselines.policy import Problem
from ikgym.arms import Arm
from ikgym.frozen import Frozen
from ikgym.validation import Bounds, FloatArray


class StopReason(enum.IntEnum):
    """Why a controller has stopped the arm."""

    #: A measurement, or the reference, has numbers that are not finite.
    NOT_FINITE = kernels.NOT_FINITE
    #: A measurement is too old, or repeats itself while the arm should move.
    STALE = kernels.STALE
    #: Joint coordinates moved farther than the arm can.
    JUMP = kernels.JUMP
    #: Joint coordinates lie outside their limits.
    OUTSIDE_LIMITS = kernels.OUTSIDE
    #: The tool is too far from the reference.
    PATH_ERROR = kernels.PATH_ERROR
    #: The policy diverged, or raised an error.
    POLICY = 6

    @property
    def label(self) -> str:
        """The name in messages, for example ``path_error``."""
        return self.name.lower()


@dataclasses.dataclass(frozen=True)
class Guards(Frozen):
    """Bounds of the measurements that a controller accepts, and how it stops.

    Args:
        age: The oldest measurements, in control periods. Joint coordinates that do not change for so long, and for the
            delay of the drives, are old, too, if commands should have moved a joint by more than `tolerance`.
        tolerance: By how much joint coordinates may move farther than at the velocity limit from one measurement to the
            next, and lie outside their limits, in [rad] or [m].
        position_error: The largest distance of the tool from the reference, in [m]; None for any.
        orientation_error: The largest angle from it, in [rad]; None for any. With the tasks ``matrix`` and ``skew`` it
            is the length of the difference of coordinates.
        stopping_time: In which time a joint stops from its velocity limit, or reaches it, where the model has no
            acceleration limit, in [s].

    Raises:
        InvalidInputError: A number is out of its range.
    """

    age: Annotated[int, Bounds(at_least=0)] = 10
    tolerance: Annotated[float, Bounds(above=0.0)] = 0.01
    position_error: Annotated[float, Bounds(above=0.0)] | None = 0.02
    orientation_error: Annotated[float, Bounds(above=0.0)] | None = 0.2
    stopping_time: Annotated[float, Bounds(above=0.0)] = 0.25

    def bounds(self, problem: Problem) -> FloatArray:
        """Least and largest joint coordinates in [rad] or [m], and the farthest way in a period. Shape (3, n)."""
        model = problem.model
        fastest = np.where(np.isfinite(model.velocity_limit), model.velocity_limit, problem.largest_qdot)
        return np.array([model.lower - self.tolerance, model.upper + self.tolerance, problem.dt * fastest])

    def numbers(self, delay: int) -> FloatArray:
        """Age, tolerance, largest errors, inf where there is none, and periods without motion, with the longest delay.

        Shape (5,).
        """
        errors = [np.inf if one is None else one for one in (self.position_error, self.orientation_error)]
        return np.array([self.age, self.tolerance, *errors, self.age + delay])

    def acceleration(self, model: Arm) -> FloatArray:
        """The acceleration limits; of joints without one by the time of a stop, in [rad/s²] or [m/s²]. Shape (n,)."""
        limit, stated = model.acceleration_limit, model.velocity_limit / self.stopping_time
        return np.where(np.isfinite(limit), limit, stated)

    def deceleration(self, problem: Problem) -> FloatArray:
        """How much velocities change in a period of a stop, in [rad/s] or [m/s]. Shape (n,)."""
        limit = problem.model.acceleration_limit
        return problem.dt * np.where(np.isfinite(limit), limit, problem.largest_qdot / self.stopping_time)
