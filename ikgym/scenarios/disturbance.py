"""What the drives add to the joint velocity that was asked for."""

from __future__ import annotations

import dataclasses

from ikgym.exceptions import InvalidInputError
from ikgym.validation import LARGEST, Frozen, frozen_array


@dataclasses.dataclass(frozen=True)
class Disturbance(Frozen):
    """What the drives add to the joint velocity that was asked for.

    Args:
        bias: A constant, in [rad/s] or [m/s]. A number, or one a joint.
        noise: Bound of a uniform random part, drawn anew at each step, in [rad/s] or [m/s]. A number, or one a
            joint.

    Raises:
        InvalidInputError: A number is not finite or beyond 1e12, or a bound negative.
    """

    bias: float | tuple[float, ...] = 0.0
    noise: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        for name in ("bias", "noise"):
            value = frozen_array(name, getattr(self, name), at_most=LARGEST)
            if value.ndim > 1 or (name == "noise" and (value < 0.0).any()):
                least = " of at least 0" if name == "noise" else ""
                raise InvalidInputError(f"{name}: expected a number{least} or one a joint, got {value.tolist()}.")
            object.__setattr__(self, name, float(value) if value.ndim == 0 else tuple(value.tolist()))
