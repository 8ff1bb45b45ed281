"""Poses and obstacles that a control loop is given, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.controller.kernels import convert
from baselines.policy.arguments import as_floats
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.outcome import OBSTACLE
from ikgym.obstacles import Obstacle
from ikgym.tasks import Task
from ikgym.validation import FloatArray, shorten

#: Task coordinates, or rotation and position.
Pose = npt.ArrayLike | tuple[npt.ArrayLike, npt.ArrayLike]


def numbers(name: str, value: Any, shape: tuple[int | None, ...]) -> FloatArray:
    """An array of a shape, None for any length; such an array is not copied, and may be not finite.

    Raises:
        InvalidInputError: It is no array of numbers of that shape.
    """
    try:
        array = as_floats(value)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name}: expected an array of real numbers, got {shorten(value)}.") from None
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
    return _convert(task, rotation[None], position[None]).ravel()


def coordinates_ahead(task: Task, reference: Any) -> FloatArray:
    """Task coordinates of the reference ahead. Shape (p, m).

    Args:
        task: The task.
        reference: Task coordinates (p, m), or rotations (p, 3, 3) and positions (p, 3) in [m].

    Raises:
        InvalidInputError: They have another shape.
    """
    if not is_pair(reference):
        return numbers("reference", reference, (None, task.size))
    rotations = numbers("reference", reference[0], (None, 3, 3))
    return _convert(task, rotations, numbers("reference", reference[1], (len(rotations), 3)))


def obstacle_rows(obstacles: npt.ArrayLike | Sequence[Obstacle] | None, count: int) -> FloatArray:
    """Rows of obstacles that are given as such, or as rows. Shape (count, 16).

    Raises:
        InvalidInputError: There are none, or another number of them.
    """
    if obstacles is None:
        raise InvalidInputError(
            f"obstacles: expected {count}, since those of the scenario move or are drawn, got None."
        )
    if isinstance(obstacles, (list, tuple)) and all(isinstance(one, Obstacle) for one in obstacles):
        obstacles = np.concatenate(
            [np.empty((0, OBSTACLE)), *(one.numbers().reshape(-1, OBSTACLE) for one in obstacles)]
        )
    return numbers("obstacles", obstacles, (count, OBSTACLE))


def _convert(task: Task, rotations: FloatArray, positions: FloatArray) -> FloatArray:
    out: FloatArray = np.empty((len(rotations), task.size))
    convert(task.kind, rotations, positions, out)
    return out
