"""Motions of several episodes at once, as kernels take them."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import Any

import numpy as np

from ikgym.kernels.motions import motion_rows
from ikgym.trajectories.trajectory import Trajectory
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
        """So many motions of this kind, to be filled in."""
        return type(self)(np.zeros((rows, *self.parameters.shape[1:])), self.duration)

    def joint_paths(self, times: FloatArray) -> FloatArray:
        """The joint path of each motion at times of its own, of shape (k, t): see :meth:`Trajectory.joint_path`."""
        return paths_of(self.parameters, times, self.duration)


def paths_of(parameters: FloatArray, times: FloatArray, duration: float) -> FloatArray:
    """Joint coordinates of k motions, see :func:`ikgym.kernels.motions.motion_rows`. Shape (k, t, n)."""
    out = np.empty((*times.shape, parameters.shape[2]))
    # Copied, since kernels would compile anew for arrays that are read-only.
    motion_rows(np.array(parameters, order="C"), np.array(times, order="C"), duration, out)
    return out
