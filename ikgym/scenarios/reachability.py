"""Poses of a path that an arm cannot reach."""

from __future__ import annotations

import dataclasses

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.scenarios.scenario import Scenario, distances
from ikgym.validation import whole_number


@dataclasses.dataclass(frozen=True)
class Gap:
    """A pose of a path that was not reached, and the distance to the nearest one found within the limits.

    Args:
        time: Time of the pose in [s].
        position: Nominal position in [m].
        distance: Between both positions, in [m].
        angle: Between both orientations, in [rad]; 0 if only the position was searched.
    """

    time: float
    position: tuple[float, float, float]
    distance: float
    angle: float


def gaps(scenario: Scenario, poses: int = 200) -> tuple[Gap, ...]:
    """The poses of the reference trajectory for which `arm.inverse` finds no joint coordinates within the limits.

    Poses are searched one by one, at equal distances in time over the episode; whether the joints can follow from one
    to the next is not checked. Where the orientation is free, or the rotation about the tool's axis, only positions are
    searched. A pose that was not found is most likely out of reach, but that is no proof.

    Args:
        scenario: A scenario that is the same at every reset.
        poses: Number of poses searched, including the first and the last; all if there are fewer.

    Returns:
        The poses that were not reached, by time.

    Raises:
        InvalidInputError: The number is less than 2, or the scenario is random.
    """
    many = whole_number("poses", poses, at_least=2)
    if scenario.random:
        raise InvalidInputError(f"gaps: expected a scenario that is the same at every reset, got {scenario.name!r}.")
    steps = np.unique(np.linspace(0, scenario.steps, many).round().astype(np.int64))
    frames = scenario.frames_of([scenario.trajectory], scenario.points()[steps][None])[0]
    rotations = frames[:, :9].reshape(-1, 3, 3) if scenario.task.error_size >= 6 else None
    q, converged = scenario.arm.inverse(rotations, frames[:, -3:])
    return tuple(
        Gap(
            float(steps[i] * scenario.dt),
            tuple(frames[i, -3:].tolist()),
            *distances(scenario.arm, q[i], None if rotations is None else rotations[i], frames[i, -3:]),
        )
        for i in np.flatnonzero(~converged)
    )
