"""Joints at their limits, whoever keeps them there: the policy or the plant."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.validation import FloatArray

#: Distance from a stop in [rad] or [m], and shares of the other limits, within which a joint is at its limit.
#: Actions are float32: rounding takes up to 1e-5 of the acceleration limit from an acceleration.
STOP, VELOCITY, ACCELERATION = 1e-6, 1e-6, 1e-4
#: Names of the limits of an arm.
BOUNDS = ("lower", "upper", "velocity_limit", "acceleration_limit")


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
    """Which joints are at their limits.

    Args:
        motion: ``q``, ``qdot`` and :data:`BOUNDS`, with ``qddot`` if there are acceleration limits, as
            :func:`baselines.evaluation.export.trajectory_log` has them.
    """
    q, qdot, qddot = motion["q"], motion["qdot"], motion.get("qddot")
    return AtLimits(
        (q <= motion["lower"] + STOP) | (q >= motion["upper"] - STOP),
        np.abs(qdot) >= (1.0 - VELOCITY) * motion["velocity_limit"],
        np.zeros(q.shape, dtype=np.bool_)
        if qddot is None
        else np.abs(qddot) >= (1.0 - ACCELERATION) * motion["acceleration_limit"],
    )
