"""The reference ahead of a control loop: each pose is converted to task coordinates once."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.controller.kernels import convert, same
from baselines.policy.arguments import as_floats
from ikgym.exceptions import InvalidInputError
from ikgym.tasks import Task
from ikgym.validation import FloatArray, shortened

#: Task coordinates, or rotation and position.
Pose = npt.ArrayLike | tuple[npt.ArrayLike, npt.ArrayLike]


def numbers(name: str, value: Any, shape: tuple[int | None, ...]) -> FloatArray:
    """An array of a shape, None for any length; what is one already is not copied, and may be not finite.

    Raises:
        InvalidInputError: It is no array of numbers of that shape.
    """
    try:
        array = as_floats(value)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name}: expected an array of real numbers, got {shortened(value)}.") from None
    given = array.shape
    if given != shape and (
        len(given) != len(shape) or any(w not in {None, n} for n, w in zip(given, shape, strict=True))
    ):
        wanted = str(shape).replace("None", "any")
        raise InvalidInputError(f"{name}: expected shape {wanted}, got {given}.")
    return array


def is_pair(pose: Any) -> bool:
    """Whether a pose, or several, are given as rotation and position."""
    return isinstance(pose, tuple) and len(pose) == 2 and np.ndim(pose[0]) == np.ndim(pose[1]) + 1


def coordinates(name: str, task: Task, pose: Any) -> FloatArray:
    """Task coordinates of one pose, given as such or as rotation (3, 3) and position (3,) in [m]. Shape (m,).

    Raises:
        InvalidInputError: It has another shape; the message has the name.
    """
    if not is_pair(pose):
        return numbers(name, pose, (task.size,))
    rotation, position = numbers(name, pose[0], (3, 3)), numbers(name, pose[1], (3,))
    out: FloatArray = np.empty((1, task.size))
    convert(task.kind, rotation[None], position[None], out)
    return out.ravel()


class Window:
    """Task coordinates of the poses ahead, which move up by one in each control period.

    Rotations and positions are compared with those of the period before. Those that only moved up are not converted
    again; where the newest pose comes alone, nothing is compared.

    Args:
        task: The task.
    """

    def __init__(self, task: Task) -> None:
        self._task = task
        self.clear()

    def clear(self, length: int = 0) -> None:
        """Forgets all poses, and makes room for others."""
        room, self._length, self._start = 2 * length, length, 0
        self._rotations, self._positions = np.full((room, 3, 3), np.nan), np.full((room, 3), np.nan)
        self._coordinates = np.full((room, self._task.size), np.nan)

    def ahead(self, reference: Pose) -> FloatArray:
        """Task coordinates of the poses ahead. Shape (p, m).

        Args:
            reference: Task coordinates (p, m), or rotations (p, 3, 3) and positions (p, 3) in [m]; or the newest
                rotation (3, 3) and position (3,) alone, the others having moved up.

        Raises:
            InvalidInputError: They have another shape.
        """
        if not is_pair(reference):
            return numbers("reference", reference, (None, self._task.size))
        first, second = reference  # type: ignore[misc, str-unpack]  # a pair
        if np.ndim(second) == 1:
            rotations, positions = numbers("reference", first, (3, 3))[None], numbers("reference", second, (3,))[None]
            self._move_up()
            self._convert(rotations, positions)
        else:
            rotations = numbers("reference", first, (None, 3, 3))
            self._take(rotations, numbers("reference", second, (len(rotations), 3)))
        return self._coordinates[self._start : self._start + self._length]

    def _take(self, rotations: FloatArray, positions: FloatArray) -> None:
        """Takes over all poses ahead, and converts the new ones."""
        if len(positions) != self._length:
            self.clear(len(positions))
        if self._matches(rotations, positions, 1):
            self._move_up()
            self._convert(rotations[-1:], positions[-1:])
        elif not self._matches(rotations, positions, 0):
            self._convert(rotations, positions)

    def _matches(self, rotations: FloatArray, positions: FloatArray, shift: int) -> bool:
        """Whether poses are those of before without the first ones, but for as many at the end."""
        here = slice(self._start + shift, self._start + self._length)
        left = self._length - shift
        return bool(same(positions[:left], self._positions[here]) and same(rotations[:left], self._rotations[here]))

    def _move_up(self) -> None:
        """Drops the first pose; where the room ends, the others are copied to its beginning."""
        if self._length == 0:
            self.clear(1)
        self._start += 1
        if self._start + self._length > len(self._coordinates):
            for array in (self._rotations, self._positions, self._coordinates):
                array[: self._length - 1] = array[self._start : self._start + self._length - 1]
            self._start = 0

    def _convert(self, rotations: FloatArray, positions: FloatArray) -> None:
        """Converts the last poses ahead."""
        end = self._start + self._length
        here = slice(end - len(positions), end)
        self._rotations[here], self._positions[here] = rotations, positions
        convert(self._task.kind, rotations, positions, self._coordinates[here])
