"""Checks of the arguments of environments: actions, seeds, and options of a reset with the starts that they choose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode

from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.kernels.simulation import first_not_finite
from ikgym.scenarios import Scenario
from ikgym.trajectories import Trajectory, joint_paths_of
from ikgym.validation import (
    BoolArray,
    FloatArray,
    float_array,
    known_names,
    one_a_row,
    shorten,
    whole_number,
)

Steps = npt.NDArray[np.int64]


def checked_seeds(seed: int | Sequence[int | None] | None, rows: int) -> Sequence[int | None]:
    """One seed a row: seed + i, or the i-th of a sequence, or None."""
    if isinstance(seed, (int, np.integer)):
        first = whole_number("seed", seed, at_least=0)
        return [first + row for row in range(rows)]
    return one_a_row("seed", seed, rows)


def checked_mask(mask: Any, rows: int) -> npt.NDArray[np.bool_]:
    """Rows to reset, by default all. Shape (N,)."""
    if mask is None:
        return np.ones(rows, dtype=np.bool_)
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (rows,):
        raise InvalidInputError(
            f"options['reset_mask']: expected a Boolean array of shape ({rows},), got {shorten(mask)}."
        )
    if not mask.any():
        raise InvalidInputError("options['reset_mask']: expected at least one true entry, got none.")
    return mask


def checked_mode(mode: str | AutoresetMode) -> AutoresetMode:
    """A mode of Gymnasium, also by its value."""
    if isinstance(mode, AutoresetMode):
        return mode
    try:
        return AutoresetMode(mode)
    except ValueError:
        raise UnknownNameError("autoreset mode", mode, [m.value for m in AutoresetMode]) from None


def checked_options(options: dict[str, Any] | None, known: Sequence[str]) -> dict[str, Any]:
    """The options of a reset."""
    if options is None:
        return {}
    if not isinstance(options, dict):
        raise InvalidInputError(f"options: expected None or a dict, got {shorten(options)}.")
    known_names("option of reset", options, known)
    return options


def take_actions(actions: npt.ArrayLike, shape: tuple[int, ...], active: BoolArray, out: FloatArray) -> None:
    """Checks actions of a shape, (n,) or (N, n), and takes them over; those of active rows are finite."""
    try:
        raw = np.asarray(actions)
    except ValueError:  # lists of different lengths
        raw = np.asarray(None)
    if raw.dtype.kind not in "fiub":
        raise InvalidInputError(f"action: expected numbers of shape {shape}, got {shorten(actions)}.")
    if raw.shape != shape:
        raise InvalidInputError(f"action: expected shape {shape}, got {raw.shape}.")
    out[:] = raw
    bad = first_not_finite(out, active)
    if bad >= 0:
        where = f" of row {bad}" if len(out) > 1 else ""
        raise InvalidInputError(
            f"action{where}: expected finite numbers, got {out[bad].tolist()}. The state is as it was."
        )


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
            f"got {shorten(starts.tolist())}."
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


def checked_arm_seeds(given: Any, rows: int, scenario: Scenario) -> list[int | None] | None:
    """Seeds of arms that are kept, one for all rows or one a row, in which None draws an arm with the episode."""
    if given is None:
        return None
    checked = one_a_row("options['arm_seed']", given, rows)
    if any(seed is not None for seed in checked):
        scenario.plant.check_draws_arm(scenario.name)
    return checked


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
