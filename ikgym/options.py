"""Checks of the arguments of environments: options, seeds, masks and autoreset modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode

from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.validation import known_names, number, one_a_row, shortened, whole_number


def checked_seeds(seed: int | Sequence[int | None] | None, rows: int) -> Sequence[int | None]:
    """One seed a row: seed + i, or the i-th of a sequence, or None.

    Raises:
        InvalidInputError: They are no whole numbers, or not one a row.
    """
    if isinstance(seed, (int, np.integer)):
        first = whole_number("seed", seed, at_least=0)
        return [first + row for row in range(rows)]
    return one_a_row("seed", seed, rows)


def checked_mask(mask: Any, rows: int) -> npt.NDArray[np.bool_]:
    """Rows to reset, by default all. Shape (N,).

    Raises:
        InvalidInputError: It is no Boolean array of that shape, or has no true entry.
    """
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
    """A mode of Gymnasium, also by its value.

    Raises:
        UnknownNameError: There is none.
    """
    if isinstance(mode, AutoresetMode):
        return mode
    try:
        return AutoresetMode(mode)
    except ValueError:
        raise UnknownNameError("autoreset mode", mode, [m.value for m in AutoresetMode]) from None


def checked_distance(distance: float | None) -> float | None:
    """The distance at which a track is lost, or None.

    Raises:
        InvalidInputError: It is no number above 0.
    """
    return None if distance is None else number("lost_distance", distance, above=0.0)


def checked_options(options: dict[str, Any] | None, known: Sequence[str]) -> dict[str, Any]:
    """The options of a reset.

    Raises:
        UnknownNameError: There is no such option.
        InvalidInputError: They are no dict.
    """
    if options is None:
        return {}
    if not isinstance(options, dict):
        raise InvalidInputError(f"options: expected None or a dict, got {shortened(options)}.")
    known_names("option of reset", options, known)
    return options
