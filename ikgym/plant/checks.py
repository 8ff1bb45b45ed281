"""Checks of the fields of a plant; each raises an InvalidInputError for a value that is none of those it names."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.validation import LARGEST, frozen_array, number, shorten, whole_number

#: One number for all joints, or one a joint.
PerJoint = float | tuple[float, ...]
#: A number, or a range (low, high) that episodes draw from.
Drawn = float | tuple[float, float]
#: Coefficients of a drive of low order: of the last velocities, and of the last commands.
VELOCITIES, COMMANDS = 3, 4
#: Largest modulus of the poles of a drive: it forgets a velocity within 45,000 steps.
LARGEST_POLE = 0.9995


def is_range(value: Any) -> bool:
    """Whether a field with one number, a range or one number a joint is a range; for two joints a pair is one, too."""
    return isinstance(value, (tuple, list, np.ndarray)) and len(value) == 2


def joint_numbers(name: str, value: Any, *, signed: bool = False) -> PerJoint:
    """One number for all joints, or one a joint; of at least 0, unless they are signed."""
    array = frozen_array(name, value, at_most=LARGEST)
    if array.ndim > 1 or not array.size or (not signed and (array < 0.0).any()):
        least = "" if signed else " of at least 0"
        raise InvalidInputError(f"{name}: expected a number{least} or one a joint, got {shorten(array.tolist())}.")
    return float(array) if array.ndim == 0 else tuple(array.tolist())


def positive(name: str, value: Any, below: float = math.inf) -> PerJoint:
    """A number above 0 and below a bound for all joints, or one a joint."""
    found = joint_numbers(name, value)
    if np.min(found) <= 0.0 or np.max(found) >= below:
        bound = "" if below == math.inf else f" and below {below:g}"
        raise InvalidInputError(f"{name}: expected numbers above 0{bound}, got {shorten(value)}.")
    return found


def frequency(name: str, value: Any) -> Drawn | PerJoint:
    """A frequency above 0 in [Hz], inf for none, or one a joint, or a range of finite ones."""
    if is_range(value):
        return _number_or_range(name, value, "numbers above 0", _frequency)
    return resonances(name, value)


def resonances(name: str, value: Any) -> PerJoint:
    """A frequency above 0 in [Hz], inf for none, or one a joint, however many joints there are."""
    given = value.tolist() if isinstance(value, np.ndarray) else value
    if not isinstance(given, (tuple, list)):
        return _frequency(name, given, endless=True)
    if not given or any(isinstance(one, (tuple, list, np.ndarray)) for one in given):
        raise InvalidInputError(f"{name}: expected a number above 0 or one a joint, got {shorten(given)}.")
    return tuple(_frequency(name, one, endless=True) for one in given)


def _frequency(name: str, value: Any, *, endless: bool = False) -> float:
    if endless and isinstance(value, float) and value == math.inf:
        return math.inf
    return number(name, value, above=0.0, at_most=LARGEST)


def numbers(name: str, value: Any) -> Drawn:
    """A number of at least 0, or a range of them."""
    check = functools.partial(number, at_least=0.0, at_most=LARGEST)
    return _number_or_range(name, value, "numbers of at least 0", check)


def steps(name: str, value: Any, at_least: int = 0) -> int | tuple[int, int]:
    """A number of steps, or a range of them."""
    drawn: Any = _number_or_range(name, value, "whole numbers", functools.partial(whole_number, at_least=at_least))
    return drawn  # type: ignore[no-any-return]  # whole numbers come as such


def delay(name: str, value: Any) -> PerJoint | tuple[int, int]:
    """A number of steps, fractions included, or one a joint, or a range of whole numbers."""
    if is_range(value):
        return steps(name, value)
    found = joint_numbers(name, value)
    return int(found) if isinstance(found, float) and found.is_integer() else found


def coefficients(name: str, value: Any) -> tuple[tuple[float, ...], ...]:
    """Coefficients of stable drives of low order: of one drive for all joints, or one row a joint; () for none."""
    width = VELOCITIES + COMMANDS
    array = frozen_array(name, value, at_most=LARGEST)
    if array.size == 0:
        return ()
    if array.ndim not in (1, 2) or array.shape[-1] != width:
        raise InvalidInputError(
            f"{name}: expected {VELOCITIES} coefficients of velocities and {COMMANDS} of commands, or such a row a "
            f"joint, got shape {array.shape}."
        )
    rows = np.atleast_2d(array)
    for j, row in enumerate(rows):
        if (pole := np.abs(np.roots([1.0, *-row[:VELOCITIES]])).max(initial=0.0)) > LARGEST_POLE:
            raise InvalidInputError(
                f"{name}: expected stable drives, whose poles are within {LARGEST_POLE}; that of joint {j + 1} has one "
                f"of modulus {pole:.6g}."
            )
    return tuple(tuple(row) for row in rows.tolist())


def shares(name: str, value: Any) -> tuple[float, float]:
    """Two different shares from 0 to 1, the smaller one first."""
    drawn = _number_or_range(name, value, "shares", functools.partial(number, at_least=0.0, at_most=1.0))
    if not isinstance(drawn, tuple) or drawn[0] == drawn[1]:
        raise InvalidInputError(f"{name}: expected two shares (near, far) with near < far, got {value!r}.")
    return drawn


def _number_or_range(name: str, value: Any, meant: str, check: Callable[[str, Any], float]) -> Drawn:
    """A number, or a range (low, high), each end of which a check takes."""
    if not isinstance(value, (tuple, list, np.ndarray)):
        return check(name, value)
    if len(value) != 2:
        raise InvalidInputError(f"{name}: expected one number or a range (low, high) of {meant}, got {value!r}.")
    low, high = (check(name, end) for end in value)
    if low > high:
        raise InvalidInputError(f"{name}: expected a range (low, high) with low <= high, got {value!r}.")
    return low, high
