"""Starts chosen by the user: joint coordinates, or a step at which an episode is entered on its joint path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.kernels.kinematics import Chain
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


def first_states(
    scenario: Scenario, points: Steps, episodes: Sequence[Trajectory], steps: Steps, chains: Chain | None
) -> tuple[FloatArray, FloatArray]:
    """The arms' first states in episodes: at rest at the start, or on the reference joint path after some steps.

    Args:
        scenario: The scenario.
        points: Its points, of `Scenario.points`.
        episodes: Trajectories of the k episodes.
        steps: Steps after which they are entered, or 0. Shape (k,).
        chains: The arms that move, of the episodes that are not entered; None where the plant is ideal.

    Returns:
        Joint coordinates in [rad] or [m], and joint velocities in [rad/s] or [m/s], none beyond what the arm can have
        applied. Shapes (k, n).
    """
    entered, shape = steps > 0, (len(steps), scenario.joints)
    q, qdot = np.empty(shape) if entered.all() else scenario.first_q_of(episodes), np.zeros(shape)
    if chains is not None and scenario.jogs and not entered.all():
        q[~entered] = scenario.jogged(q[~entered], chains)
    if entered.any():
        times = points[np.array([steps - 1, steps])].T.astype(np.float64) * scenario.dt
        paths = joint_paths_of(episodes, times)[entered]
        q[entered] = paths[:, 1]
        scenario.arm.check_posture(f"Reference joint path of scenario {scenario.name!r}", paths[:, 1])
        limit = scenario.largest_qdot
        qdot[entered] = np.clip((paths[:, 1] - paths[:, 0]) / scenario.dt, -limit, limit)
    return q, qdot
