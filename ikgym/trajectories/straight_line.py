"""A straight line between two poses."""

from __future__ import annotations

import dataclasses
from typing import Annotated

import numpy as np
import numpy.typing as npt

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.rotations import rodrigues, rotation_vector
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import LARGEST, FloatArray, Positive, frozen_array, rotation_matrix


def frame(name: str, value: npt.ArrayLike) -> FloatArray:
    """The 9 numbers of a rotation, row by row, and the position in [m], read-only. Shape (12,)."""
    numbers = frozen_array(name, value, (12,), at_most=LARGEST)
    rotation_matrix(f"rotation of {name}", numbers[:9].reshape(3, 3))
    return numbers


@dataclasses.dataclass(frozen=True, eq=False)
class StraightLine(Trajectory):
    """A straight line between two poses by a linear spline with parabolic blends, then rest (Zhang 2020, ex. 2).

    The orientation turns about one fixed axis, by the same law of time.

    Args:
        start: First frame: the 9 numbers of the rotation, row by row, and the position in [m]. Shape (12,).
        end: Last frame. Shape (12,).
        duration: Time from start to end, in [s].
        blend: Time of each parabolic blend, in [s]; at most half of the duration.

    Raises:
        InvalidInputError: A shape is wrong, a number not finite or beyond 1e12, a time below 1e-12, a rotation
            none, or the blends do not fit.
    """

    start: Annotated[FloatArray, frame]
    end: Annotated[FloatArray, frame]
    duration: Positive
    blend: Positive

    def __post_init__(self) -> None:
        super().__post_init__()
        if 2.0 * self.blend > self.duration:
            raise InvalidInputError(
                f"blend: expected at most half of the duration of {self.duration:g} s, got {self.blend:g} s."
            )

    def progress(self, times: FloatArray) -> FloatArray:
        """The share of the way covered, from 0 to 1.

        Args:
            times: Times in [s]. Shape (k,).
        """
        cruise = 1.0 / (self.duration - self.blend)
        t = np.clip(times, 0.0, self.duration)
        left = self.duration - t
        rising = 0.5 * cruise / self.blend * t**2
        falling = 1.0 - 0.5 * cruise / self.blend * left**2
        return np.where(t < self.blend, rising, np.where(left < self.blend, falling, cruise * (t - 0.5 * self.blend)))

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """See :meth:`Trajectory.frames`."""
        del model
        share = self.progress(times)
        first, last = self.start[:9].reshape(3, 3), self.end[:9].reshape(3, 3)
        vector = rotation_vector(last @ first.T)
        angle = float(np.linalg.norm(vector))
        axis = vector / angle if angle > 0.0 else np.array([0.0, 0.0, 1.0])
        rotations = np.array([rodrigues(axis, s * angle) @ first for s in share])
        positions = self.start[9:] + share[:, None] * (self.end[9:] - self.start[9:])
        return np.hstack([rotations.reshape(-1, 9), positions])
