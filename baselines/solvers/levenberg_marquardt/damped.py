"""What the iterations of Zhang 2020 share as policies: the choice of a damping rule, and its memory."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.policy import Memory, Operations, SolverPolicy
from baselines.solvers.levenberg_marquardt.damping_rules import LENGTH_POWERS, RULES, DampingLaw
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.validation import FloatArray, float_array, frozen_array, number, whole_number


@dataclasses.dataclass(frozen=True, eq=False)
class DampedIteration(SolverPolicy, abc.ABC):
    """Base of :class:`mfac.ModelFreeAdaptiveControl` and its predictive sibling: λ and when to stop.

    A number that is left out takes its default from the rule, scaled by the length l of the model's typical link: λ
    with l², as Remark 2 recommends, errors with l. A number that the rule does not have is an error.

    ===============  =============================================  ==============================================
    rule             λ                                              numbers
    ===============  =============================================  ==============================================
    ``constant``     as given (Remark 3); 0 is the shortcut (38)    damping
    ``error_ratio``  × growth where the error rose, / decay where   damping, growth, decay, carry
                     it did not (14)
    ``threshold``    × growth where the error is above a bound,     damping, growth, decay, threshold, restart,
                     / decay where not (18), and with carry (44)    carry
    ``table``        look-up by the error and cond(J) (Table I)     error_bounds, condition_bounds, dampings
    ``condition``    look-up by cond(J) (37)                        condition_bounds, dampings
    ``sugihara``     ½ weight ‖e‖² + damping                        weight, damping
    ``chan``         ½ weight ‖e‖²                                  weight
    ===============  =============================================  ==============================================

    ``error_ratio`` and ``threshold`` are read literally: what an error does to λ shows in the iteration behind it.

    Args:
        problem: What the policy is told of the scenario.
        rule: The rule for λ.
        damping: λ, or λ of the first iteration, or what is added. In the square of the Jacobian's units, [m²] and
            [1]; at least 0.
        growth: a₁. At least 1.
        decay: a₂. At least 1.
        threshold: t₁, in the units of the error, [m] and [rad]. Above 0.
        restart: Whether λ begins anew where the error rises above the threshold (Remark 2).
        carry: Whether λ goes on from period to period, instead of beginning anew.
        weight: ω. Above 0.
        error_bounds: Where the rows of the look-up meet, in the units of the error; ascending, each bound belongs to
            the row behind it.
        condition_bounds: Where its columns meet; likewise.
        dampings: λ by rows and columns; a plain sequence where there are only columns.
        tolerance: δ, norm of the error at which the iteration stops, in the units of the task. At least 0.
        iterations: N_up, most iterations of one period. At least 1.
        one_step: Whether to apply the formula once to the measured pose instead.

    Raises:
        InvalidInputError: A number is out of its range, or does not belong to the rule.
        UnknownNameError: There is no such rule.
    """

    rule: str = "constant"
    damping: float | None = None
    growth: float | None = None
    decay: float | None = None
    threshold: float | None = None
    restart: bool | None = None
    carry: bool | None = None
    weight: float | None = None
    error_bounds: tuple[float, ...] | None = None
    condition_bounds: tuple[float, ...] | None = None
    dampings: tuple[Any, ...] | None = None
    tolerance: float = 1e-10
    iterations: int = 500
    one_step: bool = False
    law: DampingLaw = dataclasses.field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise UnknownNameError("damping rule", self.rule, RULES)
        rule = RULES[self.rule]
        length = typical_link(self.problem.model)
        for name, check in _CHECKS.items():
            value = getattr(self, name)
            if name in rule.numbers:
                if value is None:
                    value = _scaled(rule.numbers[name], length ** LENGTH_POWERS.get(name, 0))
                object.__setattr__(self, name, check(name, value))
            elif value is not None:
                raise InvalidInputError(
                    f"{name}: expected nothing, as the damping rule {self.rule!r} has only "
                    f"{', '.join(rule.numbers)}; got {value!r}."
                )
        number("tolerance", self.tolerance, at_least=0.0)
        whole_number("iterations", self.iterations, at_least=1)
        _truth("one_step", self.one_step)
        object.__setattr__(self, "law", self._law(rule.kind))

    def _law(self, kind: int) -> DampingLaw:
        errors = frozen_array("error_bounds", self.error_bounds or np.empty(0))
        conditions = frozen_array("condition_bounds", self.condition_bounds or np.empty(0))
        dampings = np.atleast_2d(
            frozen_array("dampings", self.damping or 0.0 if self.dampings is None else self.dampings)
        )
        if dampings.shape != (len(errors) + 1, len(conditions) + 1):
            raise InvalidInputError(
                f"dampings: expected {len(errors) + 1} x {len(conditions) + 1} numbers, one more each way than there "
                f"are bounds, got {dampings.shape[0]} x {dampings.shape[1]}."
            )
        return DampingLaw(
            kind,
            dampings,
            errors,
            conditions,
            damping=self.damping or 0.0,
            weight=self.weight or 0.0,
            growth=self.growth or 1.0,
            decay=self.decay or 1.0,
            threshold=self.threshold or 0.0,
            restart=bool(self.restart),
        )

    @property
    def rank(self) -> int:
        """The rank of a Jacobian that has lost nothing; with redundant coordinates it is that of a rigid motion."""
        return min(self.problem.task.error_size, self.problem.model.joints, 6)

    def memory(self, rows: int) -> Memory:
        """λ, the error before, and the matrices factorised in the last step. Shapes (B,)."""
        return np.full(rows, self.law.damping), np.full(rows, np.inf), np.zeros(rows, dtype=np.int64)

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """λ as it goes on, as ``lambda``, of shape (B,): of the last iteration, or what a stepped law made of it."""
        return {"lambda": state[2]}

    def operations(self, state: Memory) -> Operations:
        """See :meth:`SolverPolicy.operations`; the factorisations are those counted while solving."""
        return super().operations(state)._replace(factorisations=state[-1].copy())

    def _start(self, memory: Memory) -> tuple[FloatArray, FloatArray, npt.NDArray[np.int64]]:
        """The memory that a solve begins with, fresh copies of it."""
        damping, error, factorised = (a.copy() for a in memory) if self.carry else self.memory(len(memory[0]))
        factorised[:] = 0
        return damping, error, factorised


def typical_link(arm: Arm) -> float:
    """The length of a typical link in [m]: the mean of all that are not 0, or 1 where there is none."""
    lengths = np.linalg.norm(np.vstack([arm.offsets, arm.tool]), axis=1)
    return float(lengths[lengths > 0.0].mean()) if lengths.any() else 1.0


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, tuple):
        return tuple(_scaled(v, factor) for v in value)
    return value if isinstance(value, bool) or factor == 1.0 else value * factor


def _truth(name: str, value: Any) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise InvalidInputError(f"{name}: expected True or False, got {value!r}.")
    return bool(value)


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
    "restart": _truth,
    "carry": _truth,
    "weight": lambda name, value: number(name, value, above=0.0),
    "error_bounds": _bounds,
    "condition_bounds": _bounds,
    "dampings": _table,
}
