"""Quantities derived from the limits of an arm, and joints at their limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.arms.arm import Arm, joint_limits
from ikgym.exceptions import InvalidInputError
from ikgym.validation import LARGEST, SMALLEST, FloatArray, per_joint

#: Distance from a stop in [rad] or [m], and shares of the other limits, within which a joint is at its limit.
#: Actions are float32: rounding takes up to 1e-5 of the acceleration limit from an acceleration.
STOP, VELOCITY, ACCELERATION = 1e-6, 1e-6, 1e-4
#: Names of the limits of an arm.
BOUNDS = ("lower", "upper", "velocity_limit", "acceleration_limit")


def velocity_scale(arm: Arm, given: npt.ArrayLike | None) -> FloatArray:
    """The joint velocities of an action of 1 in [rad/s] or [m/s]: those given, else the arm's limits. Shape (n,)."""
    without = [repr(name) for name, limit in zip(arm.joint_names, arm.velocity_limit, strict=True) if limit == np.inf]
    if given is None and without:
        raise InvalidInputError(
            f"velocity_limit: expected a number, or one a joint, since arm {arm.name!r} has no velocity limit of its "
            f"own at joint {', '.join(without)}."
        )
    limit = arm.velocity_limit if given is None else given
    return per_joint("velocity_limit", limit, arm.joints, at_least=SMALLEST, at_most=LARGEST)


def jerk_limits(arm: Arm, given: npt.ArrayLike | None) -> FloatArray:
    """The limits of jerk in [rad/s³] or [m/s³], inf for none: those given, else the arm's. Shape (n,)."""
    limit = arm.jerk_limit if given is None else given
    return joint_limits(
        "jerk_limit", np.full(arm.joints, limit) if np.ndim(limit) == 0 else limit, arm.joints, positive=True
    )


def farthest(arm: Arm) -> FloatArray:
    """The largest absolute joint coordinates within the limits in [rad] or [m], inf where there is none. Shape (n,)."""
    return np.maximum(np.abs(arm.lower), np.abs(arm.upper))


def middle(arm: Arm) -> tuple[npt.NDArray[np.bool_], FloatArray]:
    """Which joints have limits of both sides, and the middle between those in [rad] or [m], else 0. Shapes (n,)."""
    both = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    return both, 0.5 * (np.where(both, arm.lower, 0.0) + np.where(both, arm.upper, 0.0))


def limit_rows(arm: Arm, fastest: FloatArray, dt: float) -> FloatArray:
    """The limits of an arm as kernels take them, see :mod:`ikgym.kernels.limits`.

    Lower and upper limits in [rad] or [m], the largest velocities, and how much they change at most in one step of Δt,
    in [rad/s] or [m/s]. Shape (4, n), or (0, n) where the arm has no limit.
    """
    if not arm.limited:
        return np.empty((0, arm.joints))
    return np.array([arm.lower, arm.upper, fastest, dt * arm.acceleration_limit])


class AtLimits(NamedTuple):
    """Which joints are at which limit after each step.

    Attributes:
        stop: At a limit of the joint coordinate. Shape (k, n).
        velocity: At the velocity limit. Shape (k, n).
        acceleration: At the acceleration limit, or beyond, as where a stop ends a motion. Shape (k, n).
    """

    stop: npt.NDArray[np.bool_]
    velocity: npt.NDArray[np.bool_]
    acceleration: npt.NDArray[np.bool_]


def at_limits(motion: Mapping[str, FloatArray]) -> AtLimits:
    """Which joints are at their limits, whoever keeps them there: the policy or the plant.

    Args:
        motion: ``q`` and ``qdot``, of shape (k, n), with ``qddot`` if there are acceleration limits; and
            :data:`BOUNDS`, of shape (n,).
    """
    q, qdot, qddot = motion["q"], motion["qdot"], motion.get("qddot")
    return AtLimits(
        (q <= motion["lower"] + STOP) | (q >= motion["upper"] - STOP),
        np.abs(qdot) >= (1.0 - VELOCITY) * motion["velocity_limit"],
        np.zeros(q.shape, dtype=np.bool_)
        if qddot is None
        else np.abs(qddot) >= (1.0 - ACCELERATION) * motion["acceleration_limit"],
    )
