"""Starts chosen by the user: joint coordinates, or a step at which an episode is entered on its joint path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.scenarios.scenario import Scenario
from ikgym.trajectories import Trajectory, joint_paths_of
from ikgym.validation import FloatArray, float_array, one_a_row, shortened

Steps = npt.NDArray[np.int64]


def checked_starts(q: npt.ArrayLike | None, rows: int, scenario: Scenario) -> FloatArray | None:
    """Starts chosen by the user in [rad] or [m]: one for all rows or one a row, as shape (N, n); None for none."""
    if q is None:
        return None
    joints, bound = scenario.joints, scenario.start_bound()
    starts = float_array("options['q']", q)
    if starts.shape not in {(joints,), (rows, joints)}:
        raise InvalidInputError(f"options['q']: expected shape ({joints},), got {starts.shape}.")
    scenario.arm.check_posture("options['q']", starts)
    if (np.abs(starts) > bound).any():
        raise InvalidInputError(
            f"options['q']: expected absolute values of at most {np.round(bound, 4).tolist()} in [rad] or [m], "
            f"got {shortened(starts.tolist())}."
        )
    return np.broadcast_to(starts, (rows, joints))


def checked_steps(given: Any, rows: int, scenario: Scenario) -> Steps | None:
    """Steps at which episodes are entered: one for all rows or one a row, as shape (N,); None for none."""
    if given is None:
        return None
    checked = [step or 0 for step in one_a_row("options['step']", given, rows)]
    if max(checked) >= scenario.steps:
        raise InvalidInputError(
            f"options['step']: expected steps below the {scenario.steps} of the episode, got {max(checked)}."
        )
    if any(checked) and scenario.trajectory.joint_bound() is None:
        raise InvalidInputError(
            f"options['step']: expected a scenario whose reference trajectory is a joint path, so that it says where "
            f"the arm is after {max(checked)} steps; that of {scenario.name!r} is a path of the tool."
        )
    return np.array(checked, dtype=np.int64)


def entered_states(
    scenario: Scenario, points: Steps, episodes: Sequence[Trajectory], steps: Steps
) -> tuple[FloatArray, FloatArray]:
    """States of the episodes that are entered, on their reference joint paths.

    Args:
        scenario: The scenario.
        points: Its points, of `Scenario.points`.
        episodes: Trajectories of all episodes.
        steps: Steps after which k of them are entered, and 0 of the others.

    Returns:
        Joint coordinates in [rad] or [m], and joint velocities in [rad/s] or [m/s], none beyond the limits of the arm
        applied. Shapes (k, n).
    """
    times = points[np.array([steps - 1, steps])].T.astype(np.float64) * scenario.dt
    before, now = joint_paths_of(episodes, times)[steps > 0].swapaxes(0, 1)
    scenario.arm.check_posture(f"Reference joint path of scenario {scenario.name!r}", now)
    limit = scenario.largest_qdot
    return now, np.clip((now - before) / scenario.dt, -limit, limit)
