"""The nominal poses of several trajectories at once."""

from __future__ import annotations

import typing
from collections.abc import Sequence

import numpy as np

from ikgym.arms import Arm
from ikgym.trajectories.sinusoid import Sinusoid, frames_along, waves
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import FloatArray


def frames_of(trajectories: Sequence[Trajectory], times: FloatArray, model: Arm) -> FloatArray:
    """The nominal poses of several trajectories, each at times of its own.

    Args:
        trajectories: One a row.
        times: Times in [s]. Shape (k, t).
        model: The arm through whose kinematics a joint path is mapped.

    Returns:
        Bit for bit what :meth:`Trajectory.frames` gives row by row. Shape (k, t, 12) or (k, t, 3).
    """
    # What random scenarios draw by the thousands is computed at once.
    if all(type(trajectory) is Sinusoid and trajectory.sigmoid is None for trajectory in trajectories):
        sinusoids = typing.cast(Sequence[Sinusoid], trajectories)
        motions = np.array([(s.amplitude, s.frequency, s.phase, s.offset) for s in sinusoids])
        amplitude, frequency, phase, offset = motions.swapaxes(0, 1)[:, :, None]
        return frames_along(waves(times[..., None], amplitude, frequency, phase, offset, None), model)
    return np.stack([t.frames(row, model) for t, row in zip(trajectories, times, strict=True)])
