"""Checks of the fields of a plant."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
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
    return _drawn(name, value, "numbers above 0", functools.partial(number, above=0.0, at_most=LARGEST))


def numbers(name: str, value: Any) -> Drawn:
    """A number of at least 0, or a range of them.

    Raises:
        InvalidInputError: It is neither, or the range is the wrong way round.
    """
    return _drawn(name, value, "numbers of at least 0", functools.partial(number, at_least=0.0, at_most=LARGEST))


def steps(name: str, value: Any, at_least: int = 0) -> int | tuple[int, int]:
    """A number of steps, or a range of them.

    Raises:
        InvalidInputError: It is neither, or the range is the wrong way round.
    """
    drawn: Any = _drawn(name, value, "whole numbers", functools.partial(whole_number, at_least=at_least))
    return drawn  # type: ignore[no-any-return]  # whole numbers come as such


def shares(name: str, value: Any) -> tuple[float, float]:
    """Two different shares, the smaller one first.

    Raises:
        InvalidInputError: They are no such shares.
    """
    drawn = _drawn(name, value, "shares", share)
    if not isinstance(drawn, tuple) or drawn[0] == drawn[1]:
        raise InvalidInputError(f"{name}: expected two shares (near, far) with near < far, got {value!r}.")
    return drawn


def share(name: str, value: Any) -> float:
    """A share from 0 to 1.

    Raises:
        InvalidInputError: It is none.
    """
    return number(name, value, at_least=0.0, at_most=1.0)


def _drawn(name: str, value: Any, meant: str, check: Callable[[str, Any], float]) -> Drawn:
    """A number, or a range (low, high), each end of which a check takes."""
    if not isinstance(value, (tuple, list, np.ndarray)):
        return check(name, value)
    if len(value) != 2:
        raise InvalidInputError(f"{name}: expected one number or a range (low, high) of {meant}, got {value!r}.")
    low, high = (check(name, end) for end in value)
    if low > high:
        raise InvalidInputError(f"{name}: expected a range (low, high) with low <= high, got {value!r}.")
    return low, high
