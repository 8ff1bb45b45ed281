"""Rules for the damping λ of Levenberg and Marquardt, as Zhang 2020 collects them, and their parameters.

All rules are three laws in other numbers: a look-up by the error and the condition of the Jacobian, λ proportional
to the squared error, and λ stepped up or down from one iteration to the next.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.jit import expanded, inner, kernel
from ikgym.kernels.linear_algebra import orthogonal_columns
from ikgym.validation import FloatArray, float_array, frozen_array, known_name

LOOKUP, PROPORTIONAL, STEPPED = 0, 1, 2

# Keeps a growing λ finite: at this size the arm rests.
LARGEST = 1e100


class DampingLaw(NamedTuple):
    """A rule as the kernels see it. Errors are norms, in the units of the task; λ in the square of the Jacobian's.

    Attributes:
        kind: One of LOOKUP, PROPORTIONAL and STEPPED.
        dampings: λ by intervals of the error (rows) and of the condition number (columns). Shape (r, c).
        error_bounds: Where the rows meet, ascending. Shape (r - 1,).
        condition_bounds: Where the columns meet, ascending. Shape (c - 1,).
        damping: λ of the first iteration of a stepped law; the constant part of a proportional one.
        weight: ω of a proportional law.
        growth: a₁ of a stepped law.
        decay: a₂ of a stepped law.
        threshold: t₁ of a stepped law; 0 where the error before takes its place.
        restart: Whether a stepped law begins anew where the error rises above t₁.
    """

    kind: int
    dampings: FloatArray
    error_bounds: FloatArray
    condition_bounds: FloatArray
    damping: float
    weight: float
    growth: float
    decay: float
    threshold: float
    restart: bool


class Rule(NamedTuple):
    """A rule by name: its law, and the numbers it has with their defaults.

    Attributes:
        kind: The law's kind.
        numbers: Defaults by name, for an arm with links of 1 m; see :data:`LENGTH_POWERS`.
    """

    kind: int
    numbers: Mapping[str, Any]


#: How the defaults grow with the length l of a typical link, in [m]: λ with l² (Zhang 2020, Remark 2), errors with l.
LENGTH_POWERS = MappingProxyType({"damping": 2, "dampings": 2, "threshold": 1, "error_bounds": 1})

# Neither Table I nor the numbers of (37) are printed; these were found by trial, as the paper advises.
RULES: Mapping[str, Rule] = MappingProxyType(
    {
        "constant": Rule(LOOKUP, {"damping": 1e-3}),  # Remark 3
        "error_ratio": Rule(STEPPED, {"damping": 1e-3, "growth": 2.0, "decay": 2.0, "carry": False}),  # (14)
        "threshold": Rule(  # (18), and with carry (44)
            STEPPED,
            {"damping": 1e-3, "growth": 1.1, "decay": 1.02, "threshold": 0.1, "restart": False, "carry": False},
        ),
        "table": Rule(  # Table I
            LOOKUP,
            {
                "error_bounds": (1e-3, 1e-1),
                "condition_bounds": (1e2, 1e4),
                "dampings": ((0.0, 1e-6, 1e-4), (1e-6, 1e-4, 1e-2), (1e-4, 1e-2, 1e-1)),
            },
        ),
        "condition": Rule(  # (37)
            LOOKUP, {"condition_bounds": (1e2, 1e3, 1e4), "dampings": (0.0, 1e-4, 1e-3, 1e-2)}
        ),
        "sugihara": Rule(PROPORTIONAL, {"weight": 1.0, "damping": 1e-3}),  # λ = ½ ω ‖e‖² + λ₀
        "chan": Rule(PROPORTIONAL, {"weight": 1.0}),  # λ = ½ ω ‖e‖²
    }
)


@inner
def damping_now(law, error, condition, stepped):
    """λ(k)_(i).

    Args:
        law: The :class:`DampingLaw`.
        error: Norm of the error at this iteration.
        condition: Condition number at this iteration.
        stepped: Result of :func:`damping_next` at the previous iteration.
    """
    if law.kind == LOOKUP:
        return law.dampings[_interval(law.error_bounds, error), _interval(law.condition_bounds, condition)]
    if law.kind == PROPORTIONAL:
        return min(0.5 * law.weight * error * error + law.damping, LARGEST)
    return stepped


@inner
def damping_next(law, damping, error, error_before):
    """λ(k)_(i+1) of a stepped law (14), (18), (44); of others λ as it is.

    Args:
        law: The :class:`DampingLaw`.
        damping: λ(k)_(i).
        error: Norm of the error at iteration i.
        error_before: Norm of the error at iteration i - 1; infinite at the first.
    """
    if law.kind != STEPPED:
        return damping
    bound = law.threshold if law.threshold > 0.0 else error_before
    if error <= bound:
        return damping / law.decay
    if law.restart and error_before <= bound:
        return law.damping
    return min(law.growth * damping, LARGEST)


@inner
def condition_number(jacobian, rank, scratch):
    """cond(J): the largest singular value over the ``rank``-th, infinite where that is 0.

    Args:
        jacobian: J. Shape (e, n).
        rank: The rank that J has where nothing is lost, lower than e where coordinates are redundant.
        scratch: Two arrays from :func:`condition_scratch`.
    """
    columns, rotations = scratch
    e, n = jacobian.shape
    for a in range(e):
        for k in range(n):
            if e <= n:
                columns[k, a] = jacobian[a, k]
            else:
                columns[a, k] = jacobian[a, k]
    orthogonal_columns(columns, rotations)
    # The rotations are of no further use: their first row takes the squared singular values.
    squares = rotations[0]
    for c in range(squares.shape[0]):
        squares[c] = 0.0
        for r in range(columns.shape[0]):
            squares[c] += columns[r, c] * columns[r, c]
    squares.sort()
    smallest, largest = squares[squares.shape[0] - rank], squares[-1]
    return math.sqrt(largest / smallest) if smallest > 0.0 else np.inf


@expanded
def condition_scratch(size, n):
    """Workspace of :func:`condition_number`. Shapes (max(e, n), min(e, n)) and (min(e, n), min(e, n))."""
    narrow = min(size, n)
    return np.empty((max(size, n), narrow)), np.empty((narrow, narrow))


@kernel
def _interval(bounds, value):
    """Number of bounds that a value has reached."""
    i = 0
    while i < bounds.shape[0] and value >= bounds[i]:
        i += 1
    return i


def rule_defaults(rule: str, given: Mapping[str, Any], arm: Arm) -> dict[str, Any]:
    """The numbers of a rule that are left out, scaled by the arm's typical link.

    Args:
        rule: The rule's name.
        given: The numbers of all rules by name, checked; None where one is left out.
        arm: The model of the arm.

    Raises:
        InvalidInputError: A number is given that does not belong to the rule.
        UnknownNameError: There is no such rule.
    """
    known_name("damping rule", rule, RULES)
    numbers, length = RULES[rule].numbers, typical_link(arm)
    for name, value in given.items():
        if value is not None and name not in numbers:
            raise InvalidInputError(
                f"{name}: expected nothing, as the damping rule {rule!r} has only {', '.join(numbers)}; got {value!r}."
            )
    scales = {name: length ** LENGTH_POWERS.get(name, 0) for name in numbers}
    return {name: _scale(default, scales[name]) for name, default in numbers.items() if given[name] is None}


def damping_law(rule: str, parameters: Mapping[str, Any]) -> DampingLaw:
    """The law that the kernels see, from the numbers of its rule by name.

    Raises:
        InvalidInputError: The table of λ does not fit its bounds.
    """
    errors = frozen_array("error_bounds", parameters.get("error_bounds") or np.empty(0))
    conditions = frozen_array("condition_bounds", parameters.get("condition_bounds") or np.empty(0))
    damping, table = parameters.get("damping") or 0.0, parameters.get("dampings")
    dampings = np.atleast_2d(frozen_array("dampings", damping if table is None else table))
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


def _scale(value: Any, factor: float) -> Any:
    if isinstance(value, tuple):
        return tuple(_scale(v, factor) for v in value)
    return value if isinstance(value, bool) or factor == 1.0 else value * factor


def interval_bounds(name: str, value: Any) -> tuple[float, ...]:
    """Where the intervals of a look-up meet.

    Raises:
        InvalidInputError: They do not ascend from above 0.
    """
    bounds = float_array(name, value, (None,))
    if (bounds <= 0.0).any() or (np.diff(bounds) <= 0.0).any():
        raise InvalidInputError(f"{name}: expected ascending numbers above 0, got {bounds.tolist()}.")
    return tuple(bounds.tolist())


def damping_table(name: str, value: Any) -> tuple[Any, ...]:
    """The dampings of a look-up.

    Raises:
        InvalidInputError: One is below 0, or they are no rows of numbers.
    """
    table = float_array(name, value)
    if table.ndim not in (1, 2) or (table < 0.0).any():
        raise InvalidInputError(f"{name}: expected rows of numbers of at least 0, got {table.tolist()}.")
    return tuple(table.tolist()) if table.ndim == 1 else tuple(tuple(row) for row in table.tolist())
