"""The common part of the iterations of Zhang 2020 as policies: the choice of a damping rule, and its memory."""

from __future__ import annotations

import abc
import dataclasses
from typing import Annotated, Any

import numpy as np

from baselines.policy import Memory
from baselines.policy.compiled import CompiledPolicy, derived
from baselines.solvers.levenberg_marquardt.damping import (
    RULES,
    DampingLaw,
    damping_law,
    damping_table,
    interval_bounds,
    rule_defaults,
)
from baselines.solvers.levenberg_marquardt.iteration import DampingMemory, iteration_step
from ikgym.validation import Bounds, Flag, FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class DampedIteration(CompiledPolicy, abc.ABC):
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

    ``error_ratio`` and ``threshold`` are read literally: an error changes λ in the iteration after it.

    Args:
        problem: The scenario as the policy knows it.
        rule: The rule for λ.
        damping: λ, or λ of the first iteration, or the constant part. In the square of the Jacobian's units, [m²] and
            [1]; at least 0.
        growth: a₁. At least 1.
        decay: a₂. At least 1.
        threshold: t₁, in the units of the error, [m] and [rad]. Above 0.
        restart: Whether λ begins anew where the error rises above the threshold (Remark 2).
        carry: Whether λ is kept from period to period, instead of beginning anew.
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
    damping: Annotated[float, Bounds(at_least=0.0)] | None = None
    growth: Annotated[float, Bounds(at_least=1.0)] | None = None
    decay: Annotated[float, Bounds(at_least=1.0)] | None = None
    threshold: Annotated[float, Bounds(above=0.0)] | None = None
    restart: Flag | None = None
    carry: Flag | None = None
    weight: Annotated[float, Bounds(above=0.0)] | None = None
    error_bounds: Annotated[tuple[float, ...], interval_bounds] | None = None
    condition_bounds: Annotated[tuple[float, ...], interval_bounds] | None = None
    dampings: Annotated[tuple[Any, ...], damping_table] | None = None
    tolerance: Annotated[float, Bounds(at_least=0.0)] = 1e-10
    iterations: Annotated[int, Bounds(at_least=1)] = 500
    one_step: Flag = False
    #: The rule with its numbers.
    law: DampingLaw = derived()
    #: Whether λ is kept from period to period.
    carries: bool = derived()
    #: n, the points of the horizon; 1 without prediction.
    points: int = derived()
    #: Whether the Jacobians follow the predicted path (56).
    predicted: bool = derived()
    #: Whether the error of the whole horizon is tested (40), or that of the first point only.
    whole_horizon: bool = derived()

    step = iteration_step

    def __post_init__(self) -> None:
        super().__post_init__()
        given = {name: getattr(self, name) for rule in RULES.values() for name in rule.numbers}
        missing = rule_defaults(self.rule, given, self.problem.model)
        self._settle(**missing)
        law = damping_law(self.rule, given | missing)
        self._settle(law=law, carries=bool(self.carry), points=1, predicted=False, whole_horizon=False)

    def memory(self, rows: int) -> Memory:
        """A :class:`DampingMemory` without a step before."""
        return DampingMemory(np.full(rows, self.law.damping), np.full(rows, np.inf))

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """The remembered λ as ``lambda``, of shape (B,): of the last iteration, or after a stepped law."""
        return {"lambda": DampingMemory(*self.memory_of(state)).damping}
