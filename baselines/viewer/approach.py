"""The reference of arms that follow a dragged target: on a straight line to it, at limited speed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.rotations import rodrigues, rotation_vector
from ikgym.validation import FloatArray


class Pose(NamedTuple):
    """Orientation (3, 3) and position (3,) in [m] of the tool, seen from the base."""

    rotation: FloatArray
    position: FloatArray


class Approach:
    """A reference pose that moves to its target in a straight line and about one axis, at constant speeds.

    Position and orientation arrive together; the slower of them moves at its limit.

    Args:
        start: The pose of the reference.
        shift: Largest distance of one step, in [m].
        turn: Largest angle of one step, in [rad].
    """

    def __init__(self, start: Pose, shift: float, turn: float) -> None:
        self._shift, self._turn = shift, turn
        self.place(start)

    @property
    def pose(self) -> Pose:
        """The pose of the reference now."""
        (rotation,), (position,) = self.ahead([0])
        return Pose(rotation, position)

    def place(self, pose: Pose) -> None:
        """Puts reference and target at a pose."""
        self._begin(pose, pose)

    def aim(self, target: Pose) -> None:
        """Sets another target."""
        self._begin(self.pose, target)

    def advance(self) -> None:
        """Makes one step."""
        self._made += 1

    def ahead(self, steps: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Future poses of the reference.

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
        # At least one step, also if the reference is at the target already.
        self._steps = max(float(np.linalg.norm(self._way)) / self._shift, self._angle / self._turn, 1.0)
