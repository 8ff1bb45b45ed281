"""When a pose was measured, and where the joints were then."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch
from ikgym.kernels.jit import kernel
from ikgym.validation import FloatArray


class Measurement(NamedTuple):
    """What a step has measured, and what is remembered of sensors.

    Attributes:
        new: Whether the pose has not been seen before, and the joints are known where it was measured. Shape (B,).
        first: Whether an episode begins. Shape (B,).
        q: The joint coordinates there, in [rad] or [m]. Shape (B, n).
        before: Joint coordinates of the last h steps, the present one first. Shape (B, h, n).
        age: How old the pose is, in steps. Shape (B, 1).
    """

    new: npt.NDArray[np.bool_]
    first: npt.NDArray[np.bool_]
    q: FloatArray
    before: FloatArray
    age: FloatArray


def nothing_measured(rows: int, steps: int, joints: int) -> tuple[FloatArray, FloatArray]:
    """Joint coordinates before and the age of the pose, below 0, at the start of an episode.

    Args:
        rows: B.
        steps: h, how old a pose may be to be of use.
        joints: n.
    """
    return np.zeros((rows, steps, joints)), np.full((rows, 1), -1.0)


def recall(batch: Batch, dt: float, past: FloatArray, age: FloatArray) -> Measurement:
    """Joint coordinates where the pose was measured.

    A pose that is not new is one step older than the step before. Where observations do not say how old they are,
    they are of the present step.

    Args:
        batch: Observations.
        dt: Δt in [s].
        past: Joint coordinates before, as :func:`nothing_measured` or the last call gave them. Shape (B, h, n).
        age: The age of the pose at the step before. Shape (B, 1).
    """
    rows, n = batch.q.shape
    none = np.zeros((rows, 1))
    q_age = none if batch.q_age is None else batch.q_age
    pose_age = none if batch.pose_age is None else batch.pose_age
    out = Measurement(
        np.empty(rows, np.bool_), age[:, 0] < 0.0, np.empty((rows, n)), np.empty(past.shape), pose_age.copy()
    )
    recall_rows(batch.q, batch.qdot, dt, (q_age, pose_age), past, age, out.new, out.q, out.before)
    return out


@kernel
def recall_rows(q, qdot, dt, ages, past, age, new, then, before):
    """:func:`recall` row by row.

    Args:
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        qdot: Joint velocities in [rad/s] or [m/s]. Shape (B, n).
        dt: Δt in [s].
        ages: How old q and the pose are, in steps. Shapes (B, 1).
        past: Joint coordinates before. Shape (B, h, n).
        age: The age of the pose at the step before; below 0 where there was none. Shape (B, 1).
        new: Receives :attr:`Measurement.new`. Shape (B,).
        then: Receives :attr:`Measurement.q`. Shape (B, n).
        before: Receives :attr:`Measurement.before`. Shape (B, h, n).
    """
    q_age, pose_age = ages
    steps = past.shape[1]
    for row in range(q.shape[0]):
        starting = age[row, 0] < 0.0
        for i in range(steps - 1, 0, -1):
            # The arm stood before the episode.
            before[row, i] = q[row] if starting else past[row, i - 1]
        before[row, 0] = q[row]
        late = int(pose_age[row, 0] - q_age[row, 0])
        new[row] = (starting or pose_age[row, 0] < age[row, 0] + 1.0) and late < steps
        then[row] = before[row, min(max(late, 0), steps - 1)]
        for j in range(q.shape[1]):
            # Joint coordinates older than the pose are taken to have gone on.
            then[row, j] += dt * max(-late, 0) * qdot[row, j]
