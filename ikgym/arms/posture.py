"""Joint coordinates that an arm can be at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray


class Limited(Protocol):
    """An arm, as far as its limits go."""

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def joints(self) -> int:
        """The number of joints, n."""

    @property
    def prismatic(self) -> Sequence[bool]:
        """True where a joint is prismatic."""

    @property
    def lower(self) -> FloatArray:
        """Lower limits in [rad] or [m]. Shape (n,)."""

    @property
    def upper(self) -> FloatArray:
        """Upper limits in [rad] or [m]. Shape (n,)."""


def within_limits(name: str, q: FloatArray, arm: Limited) -> None:
    """Insists that an arm can be at joint coordinates.

    Args:
        name: What the coordinates are called in messages.
        q: Joint coordinates in [rad] or [m]. Shape (..., n).
        arm: The arm.

    Raises:
        InvalidInputError: A joint is outside its limits; the message names it.
    """
    rows = q.reshape(-1, arm.joints)
    outside = (rows < arm.lower) | (rows > arm.upper)
    if outside.any():
        row, joint = np.argwhere(outside)[0].tolist()
        raise InvalidInputError(
            f"{name}: expected joint {joint} of arm {arm.name!r} within its limits, from {float(arm.lower[joint])!r} "
            f"to {float(arm.upper[joint])!r} [{'m' if arm.prismatic[joint] else 'rad'}], got "
            f"{float(rows[row, joint])!r}."
        )
