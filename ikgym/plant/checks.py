"""Checks of the fields of a plant."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.validation import LARGEST, frozen_array, number, shortened, whole_number

#: One number for all joints, or one a joint.
PerJoint = float | tuple[float, ...]
#: A number, or a range (low, high) that episodes draw from.
Drawn = float | tuple[float, float]


def joint_numbers(name: str, value: Any, *, signed: bool = False) -> PerJoint:
    """One number for all joints, or one a joint.

    Args:
        name: Name in messages.
        value: The number or numbers.
        signed: Whether they may be negative.

    Raises:
        InvalidInputError: They are no such numbers, not finite, or too large.
    """
    array = frozen_array(name, value, at_most=LARGEST)
    if array.ndim > 1 or (not signed and (array < 0.0).any()):
        least = "" if signed else " of at least 0"
        raise InvalidInputError(f"{name}: expected a number{least} or one a joint, got {shortened(array.tolist())}.")
    return float(array) if array.ndim == 0 else tuple(array.tolist())


def frequency(name: str, value: Any) -> Drawn:
    """A frequency above 0, which may be infinite, or a range of finite ones.

    Raises:
        InvalidInputError: It is neither, or the range is the wrong way round.
    """
    if isinstance(value, float) and value == math.inf:
        return math.inf
    ends = _ends(name, value, "numbers above 0")
    low, high = (number(name, end, above=0.0, at_most=LARGEST) for end in ends)
    return _range(name, low, high, value)


def numbers(name: str, value: Any) -> Drawn:
    """A number of at least 0, or a range of them.

    Raises:
        InvalidInputError: It is neither, or the range is the wrong way round.
    """
    ends = _ends(name, value, "numbers of at least 0")
    low, high = (number(name, end, at_least=0.0, at_most=LARGEST) for end in ends)
    return _range(name, low, high, value)


def shares(name: str, value: Any) -> tuple[float, float]:
    """Two different shares, the smaller one first.

    Raises:
        InvalidInputError: They are no such shares.
    """
    near, far = (share(name, end) for end in _ends(name, value, "shares"))
    if near >= far:
        raise InvalidInputError(f"{name}: expected two shares (near, far) with near < far, got {value!r}.")
    return near, far


def steps(name: str, value: Any, at_least: int = 0) -> int | tuple[int, int]:
    """A number of steps, or a range of them.

    Raises:
        InvalidInputError: It is neither, or the range is the wrong way round.
    """
    low, high = (whole_number(name, end, at_least=at_least) for end in _ends(name, value, "whole numbers"))
    return _range(name, low, high, value)  # type: ignore[return-value]  # whole numbers come as such


def share(name: str, value: Any) -> float:
    """A share from 0 to 1.

    Raises:
        InvalidInputError: It is none.
    """
    return number(name, value, at_least=0.0, at_most=1.0)


def _ends(name: str, value: Any, meant: str) -> tuple[Any, Any]:
    """The ends of a range; those of a single number are the number itself."""
    if not isinstance(value, (tuple, list, np.ndarray)):
        return value, value
    if len(value) != 2:
        raise InvalidInputError(f"{name}: expected one number or a range (low, high) of {meant}, got {value!r}.")
    return value[0], value[1]


def _range(name: str, low: float, high: float, value: Any) -> float | tuple[float, float]:
    if low > high:
        raise InvalidInputError(f"{name}: expected a range (low, high) with low <= high, got {value!r}.")
    return (low, high) if isinstance(value, (tuple, list, np.ndarray)) else low
