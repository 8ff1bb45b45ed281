"""Task coordinates: the numbers in which a pose is prescribed, measured and compared."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.kernels import tasks as task_kernels
from ikgym.validation import FloatArray, ending, float_array, known_name


@dataclasses.dataclass(frozen=True)
class Task(Frozen):
    """One choice of task coordinates.

    Args:
        name: Name of the task.
        kind: Its number in the kernels.
        size: Number of coordinates, m.
        error_size: Number of components of the error, e.
        has_orientation: Whether the orientation belongs to the task.
    """

    name: str
    kind: int
    size: int
    error_size: int
    has_orientation: bool

    def coordinates(self, rotation: npt.ArrayLike, position: npt.ArrayLike) -> FloatArray:
        """Task coordinates of poses.

        Args:
            rotation: Orientations. Shape (..., 3, 3).
            position: Positions in [m]. Shape (..., 3).

        Returns:
            Coordinates. Shape (..., m).

        Raises:
            InvalidInputError: A shape is wrong, or a number not finite.
        """
        rotation, position = ending("rotation", rotation, 3, 3), ending("position", position, 3)
        lead = position.shape[:-1]
        if rotation.shape[:-2] != lead:
            raise InvalidInputError(
                f"rotation: expected shape {(*lead, 3, 3)}, as position has {position.shape}, got {rotation.shape}."
            )
        out = np.empty((*lead, self.size))
        for index in np.ndindex(lead):
            task_kernels.coordinates(self.kind, rotation[index], position[index], out[index])
        return out

    def error(self, nominal: npt.ArrayLike, coordinates: npt.ArrayLike) -> FloatArray:
        """The error of coordinates with respect to their nominal values.

        Args:
            nominal: Nominal coordinates. Shape (..., m).
            coordinates: Coordinates. Shape (..., m).

        Returns:
            ``nominal - coordinates``, for the task ``pose`` the position error in [m], then the rotation
            vector of R* Rᵀ in [rad] (Zhang 2020, eq. 51-54), and for the task ``axis`` the position error, then
            the two components across z* of the rotation vector that takes z to z* by the shortest way, in [rad].
            Its length is the angle between the axes; see :mod:`ikgym.kernels.axes`. Shape (..., e).

        Raises:
            InvalidInputError: A shape is wrong, or a number not finite.
        """
        nominal = ending("nominal", nominal, self.size)
        coordinates = ending("coordinates", coordinates, self.size)
        try:
            nominal, coordinates = np.broadcast_arrays(nominal, coordinates)
        except ValueError:
            raise InvalidInputError(
                f"coordinates: expected a shape that goes with {nominal.shape} of nominal, got {coordinates.shape}."
            ) from None
        nominal, coordinates = np.ascontiguousarray(nominal), np.ascontiguousarray(coordinates)
        out = np.empty((*nominal.shape[:-1], self.error_size))
        for index in np.ndindex(nominal.shape[:-1]):
            task_kernels.error(self.kind, nominal[index], coordinates[index], out[index])
        return out

    def jacobian(self, rotation: npt.ArrayLike, jacobian: npt.ArrayLike) -> FloatArray:
        """Derivative of the task coordinates by the joint coordinates.

        For ``pose`` and ``axis``, whose errors are not differences, this is the derivative of -error where the error
        is 0, for ``pose`` the geometric Jacobian; :meth:`error_jacobian` is exact everywhere.

        Args:
            rotation: Orientations. Shape (..., 3, 3).
            jacobian: Geometric Jacobians, linear rows first. Shape (..., 6, n).

        Returns:
            Task Jacobians. Shape (..., e, n).

        Raises:
            InvalidInputError: A shape is wrong, or a number not finite.
        """
        rotation = ending("rotation", rotation, 3, 3)
        geometric = float_array("jacobian", jacobian)
        lead = rotation.shape[:-2]
        if geometric.shape[:-1] != (*lead, 6):
            raise InvalidInputError(
                f"jacobian: expected shape {(*lead, 6, 'n')}, as rotation has {rotation.shape}, got {geometric.shape}."
            )
        out = np.empty((*lead, self.error_size, geometric.shape[-1]))
        for index in np.ndindex(lead):
            task_kernels.jacobian(self.kind, rotation[index], geometric[index], out[index])
        return out

    def error_jacobian(self, nominal: npt.ArrayLike, coordinates: npt.ArrayLike, jacobian: npt.ArrayLike) -> FloatArray:
        """Derivative of the error by the joint coordinates, exact for errors of any size below π.

        Args:
            nominal: Nominal coordinates. Shape (..., m).
            coordinates: Coordinates. Shape (..., m).
            jacobian: Task Jacobians, as :meth:`jacobian` gives them. Shape (..., e, n).

        Returns:
            ∂error/∂q. Shape (..., e, n).

        Raises:
            InvalidInputError: A shape is wrong, or a number not finite.
        """
        error, task_jacobian = self.error(nominal, coordinates), float_array("jacobian", jacobian)
        both = np.broadcast_arrays(float_array("nominal", nominal), float_array("coordinates", coordinates))
        nominal, coordinates = map(np.ascontiguousarray, both)
        if task_jacobian.ndim < 2 or task_jacobian.shape[:-1] != error.shape:
            raise InvalidInputError(
                f"jacobian: expected shape {(*error.shape, 'n')}, as the error has {error.shape}, got "
                f"{task_jacobian.shape}."
            )
        out = np.empty_like(task_jacobian)
        for index in np.ndindex(error.shape[:-1]):
            given = nominal[index], coordinates[index], error[index], task_jacobian[index]
            task_kernels.error_jacobian(self.kind, *given, out[index])
        return out


_ALL = (
    # x, y, z in [m].
    Task("position", task_kernels.POSITION, size=3, error_size=3, has_orientation=False),
    # (O^A_12, O^A_13, O^A_23, r_1, r_2, r_3), O^A the skew part of the rotation (Varga 2021).
    Task("skew", task_kernels.SKEW, size=6, error_size=6, has_orientation=True),
    # The 9 numbers of the rotation, row by row, and the position (Khan 2020).
    Task("matrix", task_kernels.MATRIX, size=12, error_size=12, has_orientation=True),
    # Coordinates as in matrix; errors of the position and the rotation vector (Zhang 2020).
    Task("pose", task_kernels.POSE, size=12, error_size=6, has_orientation=True),
    # The z axis of the tool and the position; errors of the position and of the direction. Rotation about z is free.
    Task("axis", task_kernels.AXIS, size=6, error_size=5, has_orientation=True),
)
_BY_NAME = {task.name: task for task in _ALL}


def get(name: str) -> Task:
    """The task of a name.

    Raises:
        UnknownNameError: There is no such task; the message has the nearest name.
    """
    known_name("task", name, _BY_NAME)
    return _BY_NAME[name]


def names() -> tuple[str, ...]:
    """The names of all tasks."""
    return tuple(_BY_NAME)
