"""Several trajectories at once: joint motions as kernels take them, and the nominal poses of any."""

from __future__ import annotations

import abc
import typing
from collections.abc import Sequence
from typing import Any

import numpy as np

from ikgym.arms import Arm
from ikgym.kernels.motions import motion_rows
from ikgym.trajectories.trajectory import Trajectory, frames_along
from ikgym.validation import FloatArray


class JointMotions(Sequence[Trajectory]):
    """Base of motions that are drawn by the thousands: one of them is an object only where it is asked for.

    Args:
        parameters: Control points or parameters of the k motions. Shape (k, c, n).
        duration: T in [s].
    """

    def __init__(self, parameters: FloatArray, duration: float = 0.0) -> None:
        self.parameters, self.duration = parameters, duration

    def __len__(self) -> int:
        return len(self.parameters)

    @abc.abstractmethod
    def __getitem__(self, row: Any) -> Any:
        """One of the motions."""

    def blank(self, rows: int) -> JointMotions:
        """A number of motions of this kind, to be filled in."""
        return type(self)(np.zeros((rows, *self.parameters.shape[1:])), self.duration)

    def joint_paths(self, times: FloatArray) -> FloatArray:
        """The joint path of each motion at different times, of shape (k, t): see :meth:`Trajectory.joint_path`."""
        return paths_of(self.parameters, times, self.duration)


def paths_of(parameters: FloatArray, times: FloatArray, duration: float) -> FloatArray:
    """Joint coordinates of k motions, see :func:`ikgym.kernels.motions.motion_rows`. Shape (k, t, n)."""
    out = np.empty((*times.shape, parameters.shape[2]))
    # Copied, since kernels would compile anew for arrays that are read-only.
    motion_rows(np.array(parameters, order="C"), np.array(times, order="C"), duration, out)
    return out


def frames_of(trajectories: Sequence[Trajectory], times: FloatArray, model: Arm) -> FloatArray:
    """The nominal poses of several trajectories, each at different times.

    Args:
        trajectories: One a row.
        times: Times in [s]. Shape (k, t).
        model: The arm through whose kinematics a joint path is mapped.

    Returns:
        The results of :meth:`Trajectory.frames` row by row, bit for bit. Shape (k, t, 12) or (k, t, 3).
    """
    path = _paths(trajectories, times)
    if path is not None:
        return frames_along(path, model)
    return np.stack([t.frames(row, model) for t, row in zip(trajectories, times, strict=True)])


def first_joints_of(trajectories: Sequence[Trajectory]) -> FloatArray | None:
    """Start coordinates of several trajectories; None where one has none.

    Returns:
        Joint coordinates in [rad] or [m], bit for bit those of :meth:`Trajectory.first_joints`. Shape (k, n).
    """
    path = _paths(trajectories, np.zeros((len(trajectories), 1)))
    if path is not None:
        return path[:, 0]
    rows = [trajectory.first_joints() for trajectory in trajectories]
    return None if any(row is None for row in rows) else np.stack(typing.cast(list[FloatArray], rows))


def joint_paths_of(trajectories: Sequence[Trajectory], times: FloatArray) -> FloatArray:
    """The joint paths of several trajectories that have one, each at different times.

    Args:
        trajectories: One a row.
        times: Times in [s]. Shape (k, t).

    Returns:
        Joint coordinates in [rad] or [m], bit for bit those of :meth:`Trajectory.joint_path`. Shape (k, t, n).
    """
    path = _paths(trajectories, times)
    if path is not None:
        return path
    rows = [trajectory.joint_path(row) for trajectory, row in zip(trajectories, times, strict=True)]
    return np.stack(typing.cast(list[FloatArray], rows))


def _paths(trajectories: Sequence[Trajectory], times: FloatArray) -> FloatArray | None:
    """Joint paths of shape (k, t, n), where all are of a kind that random scenarios draw by the thousands."""
    return trajectories.joint_paths(times) if isinstance(trajectories, JointMotions) else None
