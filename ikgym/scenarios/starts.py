"""Start postures of paths in space."""

from __future__ import annotations

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.rotations import geodesic_angle, quaternion_of
from ikgym.trajectories.orientations import matrices
from ikgym.validation import FloatArray, read_only

#: So many times the length of an arm away, positions are more likely in [mm] than in [m].
MILLIMETRES = 50.0


def found(name: str, arm: Arm, frame: FloatArray) -> FloatArray:
    """Joint coordinates within the limits of an arm at a pose, near to its home posture if there are some. Shape (n,).

    The frame has the 9 numbers of the rotation and the 3 of the position in [m], or the position alone.
    """
    rotation, position = (frame[:9].reshape(3, 3) if len(frame) == 12 else None), frame[-3:]
    q, converged = arm.inverse(rotation, position)
    if not converged:
        distance, angle = distances(arm, q, rotation, position)
        gap = f"{distance:.3g} m" if rotation is None else f"{distance:.3g} m and {angle:.3g} rad"
        raise InvalidInputError(
            f"Scenario {name!r}: expected a trajectory that begins where arm {arm.name!r} can be, got one that begins "
            f"{gap} from the nearest joint coordinates that were found within its limits; "
            f"{_likely(arm, rotation, position)}."
        )
    return read_only(q)


def _likely(arm: Arm, rotation: FloatArray | None, position: FloatArray) -> str:
    """The mistake that most likely leads to a first pose out of reach."""
    reach, away = arm.reach(np.zeros(arm.joints)), float(np.linalg.norm(position))
    if away > MILLIMETRES * reach:
        return f"it is {away:.4g} m away, and the arm {reach:.3g} m long: are positions in [mm]? Expected [m]"
    if rotation is not None:
        w, x, y, z = quaternion_of(*rotation)
        for order, other in {"x, y, z, w": (z, w, x, y), "w, x, y, z": (x, y, z, w)}.items():
            if arm.inverse(matrices(np.array([other]))[0], position)[1]:
                return f"with quaternions read as {order} it is in reach: is that their order? Expected w, x, y, z"
    return "give a start, or another trajectory"


def distances(arm: Arm, q: FloatArray, rotation: FloatArray | None, position: FloatArray) -> tuple[float, float]:
    """Distances of an arm from a pose, in [m] and in [rad]; the angle is 0 without an orientation."""
    there_rotation, there = arm.forward(q)
    angle = 0.0 if rotation is None else float(geodesic_angle(rotation, there_rotation))
    return float(np.linalg.norm(there - position)), angle
