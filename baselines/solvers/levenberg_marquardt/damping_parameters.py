"""The parameters of a damping rule: defaults for an arm's size, checks, and the law that the kernels see."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from baselines.solvers.levenberg_marquardt.damping_rules import LENGTH_POWERS, RULES, DampingLaw
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.validation import flag, float_array, frozen_array, known_name, number


def checked_parameters(rule: str, given: Mapping[str, Any], arm: Arm) -> dict[str, Any]:
    """The parameters that a rule has, those left out with their defaults, scaled by the arm's typical link.

    Args:
        rule: The rule's name.
        given: All parameters by name; None where one is left out.
        arm: The model of the arm.

    Raises:
        InvalidInputError: A number is out of its range, or does not belong to the rule.
        UnknownNameError: There is no such rule.
    """
    known_name("damping rule", rule, RULES)
    numbers, length, checked = RULES[rule].numbers, typical_link(arm), {}
    for name, check in _CHECKS.items():
        value = given[name]
        if name in numbers:
            default = _scaled(numbers[name], length ** LENGTH_POWERS.get(name, 0))
            checked[name] = check(name, default if value is None else value)
        elif value is not None:
            raise InvalidInputError(
                f"{name}: expected nothing, as the damping rule {rule!r} has only {', '.join(numbers)}; got {value!r}."
            )
    return checked


def damping_law(rule: str, parameters: Mapping[str, Any]) -> DampingLaw:
    """The law that the kernels see, from what :func:`checked_parameters` gave.

    Raises:
        InvalidInputError: The table of λ does not fit its bounds.
    """
    errors = frozen_array("error_bounds", parameters.get("error_bounds") or np.empty(0))
    conditions = frozen_array("condition_bounds", parameters.get("condition_bounds") or np.empty(0))
    damping = parameters.get("damping") or 0.0
    dampings = np.atleast_2d(frozen_array("dampings", parameters.get("dampings", damping)))
    if dampings.shape != (len(errors) + 1, len(conditions) + 1):
        raise InvalidInputError(
            f"dampings: expected {len(errors) + 1} x {len(conditions) + 1} numbers, one more each way than there "
            f"are bounds, got {dampings.shape[0]} x {dampings.shape[1]}."
        )
    return DampingLaw(
        RULES[rule].kind,
        dampings,
        errors,
        conditions,
        damping=damping,
        weight=parameters.get("weight") or 0.0,
        growth=parameters.get("growth") or 1.0,
        decay=parameters.get("decay") or 1.0,
        threshold=parameters.get("threshold") or 0.0,
        restart=bool(parameters.get("restart")),
    )


def typical_link(arm: Arm) -> float:
    """The length of a typical link in [m]: the mean of all that are not 0, or 1 where there is none."""
    lengths = np.linalg.norm(np.vstack([arm.offsets, arm.tool]), axis=1)
    return float(lengths[lengths > 0.0].mean()) if lengths.any() else 1.0


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, tuple):
        return tuple(_scaled(v, factor) for v in value)
    return value if isinstance(value, bool) or factor == 1.0 else value * factor


def _bounds(name: str, value: Any) -> tuple[float, ...]:
    bounds = float_array(name, value, (None,))
    if (bounds <= 0.0).any() or (np.diff(bounds) <= 0.0).any():
        raise InvalidInputError(f"{name}: expected ascending numbers above 0, got {bounds.tolist()}.")
    return tuple(bounds.tolist())


def _table(name: str, value: Any) -> tuple[Any, ...]:
    table = float_array(name, value)
    if table.ndim not in (1, 2) or (table < 0.0).any():
        raise InvalidInputError(f"{name}: expected rows of numbers of at least 0, got {table.tolist()}.")
    return tuple(table.tolist()) if table.ndim == 1 else tuple(tuple(row) for row in table.tolist())


_CHECKS: dict[str, Callable[[str, Any], Any]] = {
    "damping": lambda name, value: number(name, value, at_least=0.0),
    "growth": lambda name, value: number(name, value, at_least=1.0),
    "decay": lambda name, value: number(name, value, at_least=1.0),
    "threshold": lambda name, value: number(name, value, above=0.0),
    "restart": flag,
    "carry": flag,
    "weight": lambda name, value: number(name, value, above=0.0),
    "error_bounds": _bounds,
    "condition_bounds": _bounds,
    "dampings": _table,
}
