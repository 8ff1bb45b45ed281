"""Smooth joint motions from rest to rest, fixed, or drawn within the limits of an arm."""

from __future__ import annotations

import dataclasses
import functools
import typing
from collections.abc import Sequence
from typing import Annotated, Any, Self

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.motions import control_rows
from ikgym.trajectories.batch import JointMotions, paths_of
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import (
    LARGEST,
    SMALLEST,
    Bounds,
    FloatArray,
    Numbers,
    Positive,
    float_array,
    frozen_array,
    interval,
    per_joint,
)

# Most spans: each draw needs memory for all of them.
MOST_SPANS = 10_000
# Relative slack of bounds, for rounding.
SLACK = 1e-12


@dataclasses.dataclass(frozen=True, eq=False)
class JointSpline(Trajectory):
    """A uniform cubic B-spline in joint space, at rest before its beginning and from its end on.

    It never leaves the range of its control points; with c of them, h = T / (c - 3) apart, velocities do not exceed
    their largest difference over h, and accelerations their largest second difference over h² (de Boor, *A practical
    guide to splines*, chapter X: derivatives of a B-spline are B-splines of the differences).

    Args:
        control: Control points in [rad] or [m]; the first three are the same, and the last three. Shape (c, n), c >= 6.
        duration: T in [s].

    Raises:
        InvalidInputError: A shape is wrong, a number not finite or beyond 1e12, or an end not at rest.
    """

    control: FloatArray
    duration: Positive

    def __post_init__(self) -> None:
        super().__post_init__()
        control = frozen_array("control", self.control, (None, None), at_most=LARGEST)
        if len(control) < 6:
            raise InvalidInputError(f"control: expected at least 6 control points, got {len(control)}.")
        ends = control[[1, 2, -2, -3]] - control[[0, 0, -1, -1]]
        if ends.any():
            raise InvalidInputError("control: expected the first three to be the same and the last three, for rest.")
        self._settle(control=control)

    def joint_path(self, times: FloatArray) -> FloatArray:
        """See :meth:`Trajectory.joint_path`."""
        path: FloatArray = paths_of(self.control[None], times[None], self.duration)[0]
        return path

    def joint_bound(self) -> FloatArray:
        """See :meth:`Trajectory.joint_bound`."""
        bound: FloatArray = np.abs(self.control).max(axis=0) * (1.0 + SLACK)
        return bound


class JointSplines(JointMotions):
    """Several splines; the parameters are their control points in [rad] or [m], as those of :class:`JointSpline`."""

    def __getitem__(self, row: Any) -> Any:
        return JointSpline(self.parameters[row], self.duration)


@dataclasses.dataclass(frozen=True, eq=False)
class RandomJointSpline(Trajectory):
    """A distribution over :class:`JointSpline` that keep limits: each draw can be followed exactly.

    Each joint starts uniformly within its range, makes random moves from control point to control point, and these are
    scaled down until position, velocity and acceleration are within the limits, by a margin. So the draw itself is the
    certificate that the path of the tool is feasible from the first joint coordinates of the motion. Sampled at any Δt,
    differences of the path keep the limits of velocity and acceleration, too. Collisions are not looked at.

    Args:
        lower: Lower limits in [rad] or [m]. Shape (n,).
        upper: Upper limits in [rad] or [m]. Shape (n,).
        velocity_limit: Largest speeds in [rad/s] or [m/s]. A number, or shape (n,).
        acceleration_limit: Largest accelerations in [rad/s²] or [m/s²]. A number, or shape (n,).
        duration: From rest to rest, in [s].
        spans: Pieces of the spline; more of them make a livelier and a slower motion. From 3 to 10 000.
        margin: The share of every limit that is not used, of positions at either end of half of the range.
        scale: Each joint moves by the share U(scale) of the motion that its limits allow.

    Raises:
        InvalidInputError: A shape is wrong, a number out of its range, or a range the wrong way round.
    """

    lower: Numbers
    upper: Numbers
    velocity_limit: FloatArray
    acceleration_limit: FloatArray
    duration: Positive
    spans: Annotated[int, Bounds(at_least=3, at_most=MOST_SPANS)] = 8
    margin: Annotated[float, Bounds(at_least=0.0, at_most=0.99)] = 0.1
    scale: Annotated[tuple[float, float], functools.partial(interval, least=0.0, most=1.0)] = (0.2, 1.0)
    random: typing.ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(self.lower)
        float_array("upper", self.upper, (n,))
        if (wrong := self.lower >= self.upper).any():
            i = int(np.argmax(wrong))
            raise InvalidInputError(
                f"lower, upper: expected lower < upper, got {self.lower[i]:g} and {self.upper[i]:g} at joint {i}."
            )
        for name in ("velocity_limit", "acceleration_limit"):
            limit = per_joint(name, getattr(self, name), n, at_least=SMALLEST, at_most=LARGEST)
            self._settle(**{name: limit})

    @classmethod
    def within(cls, arm: Arm, duration: float, **parameters: Any) -> Self:
        """The distribution within the limits of an arm.

        Args:
            arm: The arm. A joint without a limit has to be given one: position and velocity limits of all joints are
                finite, or among the parameters.
            duration: From rest to rest, in [s].
            parameters: Other fields of the class, which take precedence over the arm's.

        Raises:
            InvalidInputError: A joint has no limit; the message says which, and how to give one.
        """
        limits = ("lower", "upper", "velocity_limit", "acceleration_limit")
        limits_of_arm = {name: getattr(arm, name) for name in limits if name not in parameters}
        for name, value in limits_of_arm.items():
            if without := np.flatnonzero(~np.isfinite(value)).tolist():
                raise InvalidInputError(
                    f"{name}: expected one for every joint, since arm {arm.name!r} has none at joint "
                    f"{', '.join(map(str, without))}; give {name} as a parameter."
                )
        return cls(**limits_of_arm, duration=duration, **parameters)

    def sample(self, rng: np.random.Generator) -> JointSpline:
        """See :meth:`Trajectory.sample`. Draws starts, then scales, then moves, joint by joint each."""
        motion: JointSpline = self.samples([rng])[0]
        return motion

    def samples(self, generators: Sequence[np.random.Generator]) -> JointSplines:
        """See :meth:`Trajectory.samples`; all of them are computed at once."""
        n = len(self.lower)
        drawn, control = np.empty((len(generators), self.spans, n)), np.empty((len(generators), self.spans + 3, n))
        for numbers, rng in zip(drawn, generators, strict=True):
            rng.random(out=numbers)
        control_rows(drawn, *self._bounds, *self.scale, control)
        return JointSplines(control, self.duration)

    def joint_bound(self) -> FloatArray:
        """See :meth:`Trajectory.joint_bound`; true for all that may be drawn."""
        return np.maximum(np.abs(self.lower), np.abs(self.upper))

    def check(self, model: Arm) -> None:
        """See :meth:`Trajectory.check`; the model keeps the limits that the draws do."""
        super().check(model)
        for name, within in {
            "lower": self.lower >= model.lower,
            "upper": self.upper <= model.upper,
            "velocity_limit": self.velocity_limit <= model.velocity_limit,
            "acceleration_limit": self.acceleration_limit <= model.acceleration_limit,
        }.items():
            if not within.all():
                i = int(np.argmin(within))
                raise InvalidInputError(
                    f"Trajectory: expected {name} of joint {model.joint_names[i]!r} within that of arm {model.name!r}, "
                    f"{getattr(model, name)[i]:g}, so that each draw is feasible, got {getattr(self, name)[i]:g}."
                )

    @functools.cached_property
    def _bounds(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Bounds of control points, of their differences and of their second differences. Shapes (n,)."""
        step, usable = self.duration / self.spans, 1.0 - self.margin
        room = 0.5 * self.margin * (self.upper - self.lower)
        fastest, hardest = usable * step * self.velocity_limit, usable * step**2 * self.acceleration_limit
        return self.lower + room, self.upper - room, fastest, hardest
