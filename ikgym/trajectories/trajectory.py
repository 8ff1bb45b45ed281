"""The base class of nominal trajectories."""

from __future__ import annotations

import typing
from collections.abc import Sequence

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.validation import FloatArray


class Trajectory(Frozen):
    """Base of all trajectories."""

    #: Whether an episode's trajectory is drawn when it begins.
    random: typing.ClassVar[bool] = False
    #: Whether the trajectory prescribes orientations.
    has_orientation: typing.ClassVar[bool] = True

    def sample(self, rng: np.random.Generator) -> Trajectory:
        """The trajectory of one episode.

        Args:
            rng: The episode's generator; a fixed trajectory does not touch it.
        """
        del rng
        return self

    def samples(self, generators: Sequence[np.random.Generator]) -> Sequence[Trajectory]:
        """The trajectories of several episodes, the same as :meth:`sample` draws one by one.

        Args:
            generators: One an episode.
        """
        return [self.sample(rng) for rng in generators]

    def joint_path(self, times: FloatArray) -> FloatArray | None:
        """The nominal joint coordinates in [rad] or [m], or None for a path in Cartesian space.

        Args:
            times: Times in [s]. Shape (k,).

        Returns:
            Joint coordinates. Shape (k, n).
        """
        del times
        return None

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """The nominal poses.

        Args:
            times: Times in [s]. Shape (k,).
            model: The arm through whose kinematics a joint path is mapped.

        Returns:
            Per time the 9 numbers of the rotation, row by row, and the 3 of the position in [m]; the position
            alone where there is no orientation. Shape (k, 12) or (k, 3).

        Raises:
            InvalidInputError: The trajectory is random: :meth:`sample` draws one that has poses.
        """
        path = self.joint_path(times)
        if path is None:
            raise InvalidInputError("A random trajectory has no path: sample one first.")
        return frames_along(path, model)

    def joint_bound(self) -> FloatArray | None:
        """Absolute joint coordinates that no nominal motion exceeds, in [rad] or [m]; None in Cartesian space.

        Returns:
            The bounds. Shape (n,).
        """
        return None

    def first_joints(self) -> FloatArray | None:
        """Start coordinates in [rad] or [m], on the nominal joint path; None where they depend on the scenario.

        Returns:
            Joint coordinates. Shape (n,).
        """
        path = self.joint_path(np.zeros(1))
        return None if path is None else path[0]

    def first_joints_bound(self) -> FloatArray | None:
        """Bounds of the absolute values of :meth:`first_joints`, in [rad] or [m]; None where there are none.

        Returns:
            The bounds. Shape (n,).
        """
        return self.joint_bound()

    def reach(self, times: FloatArray, model: Arm) -> float:
        """A radius around the base that the nominal positions do not leave, in [m].

        Args:
            times: All times of an episode in [s]. Shape (k,).
            model: The arm through whose kinematics a joint path is mapped.
        """
        bound = self.joint_bound()
        if bound is not None:
            return model.reach(bound)
        return float(np.linalg.norm(self.frames(times, model)[:, -3:], axis=1).max())

    def check(self, model: Arm) -> None:
        """Checks that the trajectory suits an arm.

        Raises:
            InvalidInputError: It has another number of joints.
        """
        bound = self.first_joints_bound()
        if bound is not None and len(bound) != model.joints:
            raise InvalidInputError(
                f"Trajectory: expected {model.joints} joints, as arm {model.name!r} has, got {len(bound)}."
            )


def frames_along(path: FloatArray, model: Arm) -> FloatArray:
    """The poses that an arm takes along joint coordinates of shape (..., n)."""
    rotations, positions = model.forward(path)
    return np.concatenate([rotations.reshape(*path.shape[:-1], 9), positions], axis=-1)
