"""The reference of arms whose target is moved by hand: on the straight way to it, no faster than allowed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.rotations import rodrigues, rotation_vector
from ikgym.validation import FloatArray


class Pose(NamedTuple):
    """Orientation (3, 3) and position (3,) in [m] of the tool, seen from the base."""

    rotation: FloatArray
    position: FloatArray

    @classmethod
    def at(cls, position: npt.ArrayLike, wxyz: npt.ArrayLike) -> Pose:
        """The pose of a position in [m] and a unit quaternion (w, x, y, z)."""
        w, x, y, z = np.asarray(wxyz, dtype=np.float64)
        rotation = np.array([
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ])  # fmt: skip
        return cls(rotation, np.array(position, dtype=np.float64))


class Approach:
    """A reference pose that goes to its target in a straight line, about one axis, with constant speeds.

    Position and orientation arrive together. The slower of them is as fast as it may be.

    Args:
        start: Where the reference is.
        shift: Most distance in one step, in [m].
        turn: Most angle in one step, in [rad].
    """

    def __init__(self, start: Pose, shift: float, turn: float) -> None:
        self._shift, self._turn = shift, turn
        self.place(start)

    @property
    def pose(self) -> Pose:
        """Where the reference is now."""
        (rotation,), (position,) = self.ahead([0])
        return Pose(rotation, position)

    def place(self, pose: Pose) -> None:
        """Puts reference and target at a pose."""
        self._begin(pose, pose)

    def aim(self, target: Pose) -> None:
        """Goes to another target from now on."""
        self._begin(self.pose, target)

    def advance(self) -> None:
        """Makes one step."""
        self._made += 1

    def ahead(self, steps: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Where the reference will be.

        Args:
            steps: Steps from now. Shape (p,).

        Returns:
            Rotations (p, 3, 3) and positions (p, 3) in [m].
        """
        share = np.minimum((self._made + np.asarray(steps, dtype=np.float64)) / self._steps, 1.0)
        start, way = self._start, self._way
        rotations = [rodrigues(self._axis, s * self._angle) @ start.rotation for s in share.tolist()]
        return np.array(rotations), start.position + share[:, None] * way

    def _begin(self, start: Pose, target: Pose) -> None:
        self._start, self._made = start, 0
        self._way = target.position - start.position
        vector = rotation_vector(np.ascontiguousarray(target.rotation @ start.rotation.T))
        self._angle = float(np.linalg.norm(vector))
        self._axis = vector / self._angle if self._angle else np.array([0.0, 0.0, 1.0])
        # At least one step, in which nothing moves where the reference is there already.
        self._steps = max(float(np.linalg.norm(self._way)) / self._shift, self._angle / self._turn, 1.0)
