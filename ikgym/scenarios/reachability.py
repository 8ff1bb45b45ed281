"""Which poses of a path an arm cannot take."""

from __future__ import annotations

import dataclasses

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.scenarios.scenario import Scenario
from ikgym.scenarios.starts import distances
from ikgym.validation import whole_number


@dataclasses.dataclass(frozen=True)
class Gap:
    """A pose of a path, and how far the nearest is that was found within the limits of the arm.

    Args:
        time: When the path is there, in [s].
        position: Where the path is then, in [m].
        distance: Between both positions, in [m].
        angle: Between both orientations, in [rad]; 0 where the position alone was looked for.
    """

    time: float
    position: tuple[float, float, float]
    distance: float
    angle: float


def gaps(scenario: Scenario, poses: int = 200) -> tuple[Gap, ...]:
    """The poses of the reference trajectory for which `arm.inverse` finds no joint coordinates within the limits.

    Poses are looked at one by one, at equal distances of time over the episode: whether the joints can follow from one
    to the next is what policies show. Where the rotation about the tool's axis is free, or the orientation, positions
    alone are looked at. What was not found is out of reach in all likelihood, but that is no proof.

    Args:
        scenario: What is to be tracked, the same at every reset.
        poses: How many are looked at, the first and the last among them; all where there are fewer.

    Returns:
        The poses that were missed, by time; none where all can be taken.

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
