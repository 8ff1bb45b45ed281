"""Rules for the damping λ of Levenberg and Marquardt, as Zhang 2020 collects them.

All rules are three laws in other numbers: a look-up by the error and the condition of the Jacobian, λ proportional
to the squared error, and λ stepped up or down from one iteration to the next.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from baselines.solvers.linear_algebra import orthogonal_columns
from ikgym.kernels.jit import expanded, kernel
from ikgym.validation import FloatArray

LOOKUP, PROPORTIONAL, STEPPED = 0, 1, 2

# Keeps a growing λ finite: at this size the arm stands still.
LARGEST = 1e100


class DampingLaw(NamedTuple):
    """A rule as the kernels see it. Errors are norms, in the units of the task; λ in the square of the Jacobian's.

    Attributes:
        kind: One of LOOKUP, PROPORTIONAL and STEPPED.
        dampings: λ by intervals of the error (rows) and of the condition number (columns). Shape (r, c).
        error_bounds: Where the rows meet, ascending. Shape (r - 1,).
        condition_bounds: Where the columns meet, ascending. Shape (c - 1,).
        damping: λ of the first iteration of a stepped law; what a proportional one adds.
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


@kernel
def damping_now(law, error, condition, stepped):
    """λ(k)_(i).

    Args:
        law: The :class:`DampingLaw`.
        error: Norm of the error at this iteration.
        condition: Condition number at this iteration.
        stepped: What :func:`damping_next` gave at the iteration before.
    """
    if law.kind == LOOKUP:
        return law.dampings[_interval(law.error_bounds, error), _interval(law.condition_bounds, condition)]
    if law.kind == PROPORTIONAL:
        return min(0.5 * law.weight * error * error + law.damping, LARGEST)
    return stepped


@kernel
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


@kernel
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
    """What :func:`condition_number` works with. Shapes (max(e, n), min(e, n)) and (min(e, n), min(e, n))."""
    narrow = min(size, n)
    return np.empty((max(size, n), narrow)), np.empty((narrow, narrow))


@kernel
def _interval(bounds, value):
    """How many bounds a value has reached."""
    i = 0
    while i < bounds.shape[0] and value >= bounds[i]:
        i += 1
    return i
