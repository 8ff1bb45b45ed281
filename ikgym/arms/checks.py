"""Checks of an arm's fields."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.validation import LARGEST, UNIT_TOLERANCE, FloatArray, different_texts, float_array, read_only, shortened

# Within this of length 1, a vector is a rounded unit vector: three floats cannot come closer in general.
ROUNDING = 4e-16


def unit_axes(name: str, value: npt.ArrayLike) -> FloatArray:
    """Axes of exactly unit length, read-only. Shape (n, 3)."""
    axes = float_array(name, value, (None, 3), at_most=LARGEST)
    lengths: FloatArray = np.linalg.norm(axes, axis=1)
    for i, length in enumerate(lengths):
        if abs(length - 1.0) > UNIT_TOLERANCE:
            got = "the zero vector" if length == 0.0 else f"{axes[i].tolist()} of length {length:.6g}"
            raise InvalidInputError(
                f"{name}: expected a unit vector for joint {i}, got {got}. Axes are not normalised silently, because a "
                "wrong length is usually a mistake; divide by the length if it is meant."
            )
    # A rounded unit vector divided by its length again may change in the last bit, and a copy must equal the arm.
    exact = np.abs(lengths - 1.0) <= ROUNDING
    return read_only(np.where(exact[:, None], axes, axes / lengths[:, None]))


def truth_values(name: str, prismatic: Any, n: int) -> tuple[bool, ...]:
    """Which joints are prismatic, one entry a joint."""
    values = (tuple(prismatic) or (False,) * n) if isinstance(prismatic, Iterable) else ()
    if len(values) != n or not all(isinstance(value, (bool, np.bool_)) for value in values):
        raise InvalidInputError(f"{name}: expected {n} truth values, one a joint, got {shortened(prismatic)}.")
    return tuple(bool(value) for value in values)


def numbered_joints(n: int) -> tuple[str, ...]:
    """The default names of joints."""
    return tuple(f"joint_{i + 1}" for i in range(n))


def joint_names(name: str, given: Any, n: int) -> tuple[str, ...]:
    """Names of the joints; none are given by an empty list."""
    return numbered_joints(n) if isinstance(given, (tuple, list)) and not given else different_texts(name, given, n)


def limits(
    name: str, value: npt.ArrayLike | None, n: int, default: float = np.inf, *, positive: bool = False
) -> FloatArray:
    """Limits of the joints, which may be infinite, read-only. Shape (n,)."""
    if value is None:
        return read_only(np.full(n, default))
    try:
        raw = np.asarray(value)
        # NumPy would read strings as numbers.
        if raw.dtype.kind not in "fiu" or raw.shape != (n,) or np.isnan(raw).any():
            raise ValueError
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name}: expected {n} numbers, got {shortened(value)}.") from None
    if positive and (raw <= 0.0).any():
        raise InvalidInputError(f"{name}: expected numbers above 0, got {raw.tolist()}.")
    return read_only(raw.astype(np.float64))
