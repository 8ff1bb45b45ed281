"""Checks of the arguments of environments: options, seeds, masks and autoreset modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode

from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.kernels.simulation import first_not_finite
from ikgym.validation import BoolArray, FloatArray, known_names, number, one_a_row, shortened, whole_number


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
            f"options['reset_mask']: expected a Boolean array of shape ({rows},), got {shortened(mask)}."
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


def checked_distance(distance: float | None) -> float | None:
    """The distance at which a track is lost, or None."""
    return None if distance is None else number("lost_distance", distance, above=0.0)


def checked_options(options: dict[str, Any] | None, known: Sequence[str]) -> dict[str, Any]:
    """The options of a reset."""
    if options is None:
        return {}
    if not isinstance(options, dict):
        raise InvalidInputError(f"options: expected None or a dict, got {shortened(options)}.")
    known_names("option of reset", options, known)
    return options


def take_actions(actions: npt.ArrayLike, shape: tuple[int, ...], active: BoolArray, out: FloatArray) -> None:
    """Checks actions of a shape, (n,) or (N, n), and takes them over; those of active rows are finite."""
    try:
        raw = np.asarray(actions)
    except ValueError:  # lists of different lengths
        raw = np.asarray(None)
    if raw.dtype.kind not in "fiub":
        raise InvalidInputError(f"action: expected numbers of shape {shape}, got {shortened(actions)}.")
    if raw.shape != shape:
        raise InvalidInputError(f"action: expected shape {shape}, got {raw.shape}.")
    out[:] = raw
    bad = first_not_finite(out, active)
    if bad >= 0:
        where = f" of row {bad}" if len(out) > 1 else ""
        raise InvalidInputError(
            f"action{where}: expected finite numbers, got {out[bad].tolist()}. The state is as it was."
        )
