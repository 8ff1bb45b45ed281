"""Checks of numbers that have an upper limit, too."""

from __future__ import annotations

from ikgym.exceptions import InvalidInputError
from ikgym.validation import number, whole_number

#: Largest values of options, so that a typing error ends with a message, and not for want of memory.
MOST_ARMS = 10_000
MOST_LAYERS, MOST_NEURONS = 10, 2048
MOST_STEPS_AHEAD = 100_000
MOST_TRANSITIONS = 10_000_000
MOST_BATCH = 1_000_000
MOST_RATE = 1e30  # weights are float32


def count(name: str, value: int, *, at_most: int, at_least: int = 1) -> int:
    """A whole number between two limits.

    Raises:
        InvalidInputError: It is none.
    """
    out = whole_number(name, value, at_least=at_least)
    if out > at_most:
        raise InvalidInputError(f"{name}: expected a whole number from {at_least} to {at_most}, got {out}.")
    return out


def between(name: str, value: float, low: float, high: float) -> float:
    """A number between two limits, both of them included.

    Raises:
        InvalidInputError: It is none.
    """
    out = number(name, value)
    if not low <= out <= high:
        raise InvalidInputError(f"{name}: expected a number from {low:g} to {high:g}, got {out:g}.")
    return out


def share(name: str, value: float) -> float:
    """A number above 0, at most 1.

    Raises:
        InvalidInputError: It is none.
    """
    out = number(name, value, above=0.0)
    if out > 1.0:
        raise InvalidInputError(f"{name}: expected a number above 0, at most 1, got {out:g}.")
    return out
