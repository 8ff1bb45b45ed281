"""Orientation laws: how a tool is turned on its way along a path."""

from __future__ import annotations

import abc
import dataclasses
import math
from typing import Annotated

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.trajectories.paths import Path
from ikgym.trajectories.splines import CubicSpline
from ikgym.validation import LARGEST, Direction, FloatArray, Rotation, Vector, float_array, read_only

# Quaternions of files are rounded: so far may their length be from 1.
QUATERNION_TOLERANCE = 1e-5
# The sine of the least angle between the approach and the path, and at how many points of it that is looked at.
LEAST_SINE, LOOKED_AT = 0.01, 2001


def aligned_quaternions(name: str, value: npt.ArrayLike) -> FloatArray:
    """Unit quaternions w, x, y, z, each with the sign that is nearer to the one before. Shape (k, 4)."""
    given = float_array(name, value, (None, 4), at_most=LARGEST)
    lengths = np.linalg.norm(given, axis=1)
    if (np.abs(lengths - 1.0) > QUATERNION_TOLERANCE).any():
        i = int(np.argmax(np.abs(lengths - 1.0)))
        raise InvalidInputError(
            f"{name}: expected unit quaternions, got {given[i].tolist()} of length {lengths[i]:.6g} as number {i}."
        )
    exact = given if (np.abs(lengths - 1.0) <= 4e-16).all() else given / lengths[:, None]
    along = np.sum(exact[1:] * exact[:-1], axis=1)
    if (np.abs(along) < 1e-6).any():
        i = int(np.argmin(np.abs(along)))
        raise InvalidInputError(
            f"{name}: expected less than half a turn from one to the next, got half a turn from number {i} to number "
            f"{i + 1}; a waypoint in between says which way around."
        )
    signs = np.concatenate([[1.0], np.cumprod(np.where(along < 0.0, -1.0, 1.0))])
    return read_only(exact * signs[:, None])


Quaternions = Annotated[FloatArray, aligned_quaternions]


class Orientation(Frozen, abc.ABC):
    """The orientation of a tool as a function of the arc length of its path."""

    def check(self, path: Path) -> None:
        """Checks that the law suits a path.

        Raises:
            InvalidInputError: It does not.
        """
        del path

    @abc.abstractmethod
    def rotations(self, path: Path, s: FloatArray) -> FloatArray:
        """Rotation matrices.

        Args:
            path: The path.
            s: Arc lengths in [m]. Shape (k,).

        Returns:
            Shape (k, 3, 3).
        """


@dataclasses.dataclass(frozen=True, eq=False)
class FixedOrientation(Orientation):
    """The same orientation everywhere.

    Args:
        rotation: Of the tool. Shape (3, 3).

    Raises:
        InvalidInputError: It is no rotation.
    """

    rotation: Rotation

    def rotations(self, path: Path, s: FloatArray) -> FloatArray:
        """See :meth:`Orientation.rotations`."""
        return np.tile(self.rotation, (len(s), 1, 1))


@dataclasses.dataclass(frozen=True, eq=False)
class AlongPath(Orientation):
    """A tool whose x axis leads along the path, its z axis as near to a direction as that allows.

    Args:
        approach: The direction that the z axis keeps to; its length does not matter. Shape (3,).
        rotation: Of the tool in that frame, the frame itself if left out. Shape (3, 3).

    Raises:
        InvalidInputError: The approach is zero, or the rotation none.
    """

    approach: Direction = dataclasses.field(default_factory=lambda: np.array([0.0, 0.0, -1.0]))
    rotation: Rotation = dataclasses.field(default_factory=lambda: np.eye(3))

    def check(self, path: Path) -> None:
        """See :meth:`Orientation.check`: the path may nowhere lead in the direction of the approach."""
        s = np.linspace(0.0, path.length, LOOKED_AT)
        sines = np.linalg.norm(np.cross(path.along(s)[1], self._unit()), axis=1)
        if (sines < LEAST_SINE).any():
            i = int(np.argmin(sines))
            raise InvalidInputError(
                f"approach: expected a direction across the path, got {self.approach.tolist()}, along which it leads "
                f"after {s[i]:.6g} m."
            )

    def rotations(self, path: Path, s: FloatArray) -> FloatArray:
        """See :meth:`Orientation.rotations`."""
        x = path.along(s)[1]
        z = self._unit() - (x @ self._unit())[:, None] * x
        z /= np.linalg.norm(z, axis=1)[:, None]
        return np.stack([x, np.cross(z, x), z], axis=2) @ self.rotation

    def _unit(self) -> FloatArray:
        unit: FloatArray = self.approach / np.linalg.norm(self.approach)
        return unit


@dataclasses.dataclass(frozen=True, eq=False)
class Turning(Orientation):
    """A tool that turns about a fixed axis, in step with the length covered.

    Args:
        rotation: At the start. Shape (3, 3).
        vector: The whole turn as axis times angle, in [rad], in the base frame; it may be more than one turn.
            Shape (3,).

    Raises:
        InvalidInputError: The rotation is none, or the vector.
    """

    rotation: Rotation
    vector: Vector

    def rotations(self, path: Path, s: FloatArray) -> FloatArray:
        """See :meth:`Orientation.rotations`, with Rodrigues' formula."""
        angle = float(np.linalg.norm(self.vector))
        x, y, z = self.vector / angle if angle > 0.0 else self.vector
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turn = (s / path.length * angle)[:, None, None]
        turned: FloatArray = np.eye(3) + np.sin(turn) * cross + 2.0 * np.sin(0.5 * turn) ** 2 * (cross @ cross)
        return turned @ self.rotation


@dataclasses.dataclass(frozen=True, eq=False)
class OrientationThrough(Orientation):
    """A smooth orientation through one at each waypoint: the cubic spline through the quaternions, normalised.

    Args:
        quaternions: w, x, y, z; one a waypoint of the path, at its :attr:`Path.stations`. Shape (k, 4).

    Raises:
        InvalidInputError: One has not the length 1, or two that follow each other are half a turn apart, so that the
            way around is not determined.
    """

    quaternions: Quaternions

    def check(self, path: Path) -> None:
        """See :meth:`Orientation.check`: the path has as many waypoints."""
        if len(self.quaternions) != len(path.stations):
            raise InvalidInputError(
                f"quaternions: expected {len(path.stations)}, one a waypoint of the path, got {len(self.quaternions)}."
            )

    def rotations(self, path: Path, s: FloatArray) -> FloatArray:
        """See :meth:`Orientation.rotations`."""
        return matrices(CubicSpline.through(path.stations, self.quaternions, at_rest=False)(s))


def matrices(quaternions: FloatArray) -> FloatArray:
    """The rotation matrices of quaternions w, x, y, z of any length but 0. Shapes (k, 4) and (k, 3, 3)."""
    w, x, y, z = (quaternions * (math.sqrt(2.0) / np.linalg.norm(quaternions, axis=1)[:, None])).T
    return np.array(
        [
            [1.0 - y * y - z * z, x * y - w * z, x * z + w * y],
            [x * y + w * z, 1.0 - x * x - z * z, y * z - w * x],
            [x * z - w * y, y * z + w * x, 1.0 - x * x - y * y],
        ]
    ).transpose(2, 0, 1)


#: The orientation laws by their names in scenario files.
ORIENTATIONS: dict[str, type[Orientation]] = {
    "fixed": FixedOrientation,
    "along_path": AlongPath,
    "turning": Turning,
    "through": OrientationThrough,
}
