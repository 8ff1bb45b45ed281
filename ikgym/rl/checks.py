"""Spaces and checks that single and vector wrappers share."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray, number, shortened


def action_box(joints: int, share: float, largest: float) -> tuple[spaces.Box, float]:
    """The space of actions up to a bound in units of velocity, and the share of a unit that an action of 1 means.

    Raises:
        InvalidInputError: One of them is not above 0.
    """
    share, largest = number("share", share, above=0.0), number("largest", largest, above=0.0)
    return spaces.Box(-largest / share, largest / share, (joints,), np.float32), share


def checked_action(action: npt.ArrayLike, space: Any) -> FloatArray:
    """Actions cut to their box, as float64.

    Raises:
        InvalidInputError: They have a wrong shape or type.
    """
    raw = np.asarray(action)
    if raw.dtype.kind not in "fiub" or raw.shape != space.shape:
        raise InvalidInputError(f"action: expected numbers of shape {space.shape}, got {shortened(action)}.")
    out: FloatArray = np.clip(raw.astype(np.float64), space.low, space.high)
    return out


def history_box(space: spaces.Space[Any], length: int) -> spaces.Box:
    """Several observations of a space side by side.

    Raises:
        InvalidInputError: They are no vectors.
    """
    if not isinstance(space, spaces.Box) or len(space.shape) != 1:
        raise InvalidInputError(f"History: expected an environment whose observation is a vector, got {space}.")
    return spaces.Box(np.tile(space.low, length), np.tile(space.high, length), dtype=np.float32)
