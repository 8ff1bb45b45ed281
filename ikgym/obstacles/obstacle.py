"""Obstacles: spheres, capsules, boxes and half-spaces around an arm, at rest or moving."""

from __future__ import annotations

import abc
import dataclasses
import typing
from collections.abc import Sequence

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.trajectories import Trajectory
from ikgym.validation import (
    IDENTITY,
    Direction,
    FloatArray,
    Positive,
    Rotation,
    Sizes,
    Vector,
    about,
    shorten,
)


@dataclasses.dataclass(frozen=True, eq=False)
class Obstacle(Frozen, abc.ABC):
    """Base of all obstacles.

    Args:
        name: Its name.
        motion: The trajectory of the frame that it is fixed to; at rest, in the base frame, if left out.
        ignored: Names of bodies that may touch it.
        count: How many rows of numbers it has.

    Raises:
        InvalidInputError: A value is wrong.
    """

    name: str
    motion: Trajectory | None = dataclasses.field(default=None, kw_only=True)
    ignored: Sequence[str] = dataclasses.field(default=(), kw_only=True)
    count: int = dataclasses.field(default=1, init=False, repr=False)
    #: Whether it is drawn when an episode begins.
    random: typing.ClassVar[bool] = False

    def __post_init__(self) -> None:
        with about(f"Obstacle {shorten(self.name)}"):
            super().__post_init__()
            self._check()
        self._settle(ignored=tuple(self.ignored))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its rows."""
        return (self.name,)

    def _check(self) -> None:
        """Checks the fields together."""
        if not self.name:
            raise InvalidInputError("name: expected a text, got an empty one.")
        if self.motion is not None and self.motion.random:
            raise InvalidInputError(f"motion: expected a trajectory that is not random, got {shorten(self.motion)}.")
        if not isinstance(self.ignored, (tuple, list)) or not all(isinstance(one, str) for one in self.ignored):
            raise InvalidInputError(f"ignored: expected a list of names of bodies, got {shorten(self.ignored)}.")

    @abc.abstractmethod
    def numbers(self) -> FloatArray:
        """The obstacle as a row of :class:`ikgym.kernels.bodies.Surroundings`, at its initial place. Shape (16,).

        One that has several rows gives all of them, in shape (count, 16).
        """

    def along(self, times: FloatArray, model: Arm) -> FloatArray:
        """The numbers at some times; those of an obstacle at rest have a single row.

        Args:
            times: In [s]. Shape (k,).
            model: The arm through whose kinematics the motion is mapped where it is a joint path.

        Returns:
            Shape (k, 16), or (1, 16) at rest.
        """
        numbers = self.numbers()
        if self.motion is None:
            return numbers[None]
        frames, out = self.motion.frames(times, model), np.tile(numbers, (len(times), 1))
        rotations = frames[:, :9].reshape(-1, 3, 3) if frames.shape[1] == 12 else np.tile(IDENTITY, (len(times), 1, 1))
        out[:, :9] = (rotations @ numbers[:9].reshape(3, 3)).reshape(-1, 9)
        out[:, 9:12] = frames[:, -3:] + rotations @ numbers[9:12]
        return out


@dataclasses.dataclass(frozen=True, eq=False)
class Sphere(Obstacle):
    """A sphere. See :class:`Obstacle`.

    Args:
        position: Its centre in the base frame, or in the frame of the motion, in [m]. Shape (3,).
        radius: In [m].
    """

    position: Vector
    radius: Positive

    def numbers(self) -> FloatArray:
        """See :meth:`Obstacle.numbers`."""
        return _row(IDENTITY, self.position, np.zeros(3), self.radius)


@dataclasses.dataclass(frozen=True, eq=False)
class Capsule(Obstacle):
    """All that is within a radius of a segment. See :class:`Obstacle`.

    Args:
        start: One end of the segment in the base frame, or in the frame of the motion, in [m]. Shape (3,).
        end: The other end, in [m]. Shape (3,).
        radius: In [m].
    """

    start: Vector
    end: Vector
    radius: Positive

    def numbers(self) -> FloatArray:
        """See :meth:`Obstacle.numbers`."""
        along = self.end - self.start
        length = float(np.linalg.norm(along))
        rotation = IDENTITY if length == 0.0 else towards(along / length)
        return _row(rotation, 0.5 * (self.start + self.end), np.array([0.0, 0.0, 0.5 * length]), self.radius)


@dataclasses.dataclass(frozen=True, eq=False)
class Box(Obstacle):
    """A box. See :class:`Obstacle`.

    Args:
        position: Its centre in the base frame, or in the frame of the motion, in [m]. Shape (3,).
        size: Lengths of its edges in [m], above 0. Shape (3,).
        rotation: A rotation matrix whose columns are the directions of its edges. Shape (3, 3).
    """

    position: Vector
    size: Sizes
    rotation: Rotation = dataclasses.field(default_factory=lambda: np.eye(3))

    def numbers(self) -> FloatArray:
        """See :meth:`Obstacle.numbers`."""
        return _row(self.rotation, self.position, 0.5 * self.size, 0.0)


@dataclasses.dataclass(frozen=True, eq=False)
class HalfSpace(Obstacle):
    """All that is on one side of a plane, such as a floor or a wall. See :class:`Obstacle`.

    Args:
        position: A point of the plane in the base frame, or in the frame of the motion, in [m]. Shape (3,).
        normal: The direction out of it, a vector of any length above 0. Shape (3,).
    """

    position: Vector
    normal: Direction

    def numbers(self) -> FloatArray:
        """See :meth:`Obstacle.numbers`."""
        normal = self.normal / np.linalg.norm(self.normal)
        return _row(towards(normal), self.position, np.full(3, -1.0), 0.0)


def _row(rotation: FloatArray, position: FloatArray, half: FloatArray, radius: float) -> FloatArray:
    return np.concatenate([np.ravel(rotation), position, half, [radius]])


def towards(direction: FloatArray) -> FloatArray:
    """Rotations whose third axes are unit vectors, of shapes (..., 3, 3) and (..., 3)."""
    other = np.eye(3)[np.argmin(np.abs(direction), axis=-1)]
    first = np.cross(other, direction)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, np.cross(direction, first), direction], axis=-1)
