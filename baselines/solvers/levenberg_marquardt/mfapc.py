"""Model-free adaptive predictive control: damped least squares over a horizon (Zhang 2020, sections IV and V)."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar, Literal

from baselines.solvers.levenberg_marquardt.base import DampedIteration
from ikgym.validation import Bounds


@dataclasses.dataclass(frozen=True, eq=False)
class ModelFreeAdaptivePredictiveControl(DampedIteration):
    """Goes towards the next n nominal points at once, by damped least squares of the joint shifts between them.

    At each iteration all residuals are taken from the present iterate, r_j = e(y*(k+j), F(q_(i-1))), and
    ``ΔQ = (Ψ̄ᵀ Ψ̄ + λ I)⁻¹ Ψ̄ᵀ r`` (36) is solved block by block, see
    :mod:`levenberg_marquardt.block_tridiagonal`; only the first
    shift is kept (57). The Jacobians belong to the iterate itself or, from the second iteration on, to the
    path that ΔQ predicts (56); the paper says of the first only that it begins at q(k). With n = 1 this is
    :class:`mfac.ModelFreeAdaptiveControl`, and so is the first shift at λ = 0 (38) for any n.

    The test (40) asks that the whole predicted path meet its points. At λ = 0 the points behind the first are met
    to the second order of the motion per period, and with λ > 0 the first shift vanishes near the point, where
    the terms of the points ahead and of the first one cancel: on a moving trajectory the printed δ is out of reach and
    the status ``iteration_limit``. ``stop="first_point"`` asks it of the point that the arm is sent to only.

    Statuses are those of :class:`baselines.solvers.levenberg_marquardt.mfac.ModelFreeAdaptiveControl`.

    Args:
        problem: The scenario as the policy knows it.
        rule: The rule for λ; it and the ten numbers behind it are those of :class:`DampedIteration`. Its error is
            the norm of (40), its condition number the largest over the horizon (37).
        tolerance: δ, norm of the error at which the iteration stops, in the units of the task, [m] and [rad].
        iterations: N_up, most iterations of one period.
        one_step: Whether to apply the controller (27), (28) once to the measured pose; δ and N_up do not matter then,
            and the status is ``applied`` where J has full rank.
        horizon: n, the points that must be shown ahead.
        jacobians: ``"predicted"`` over the horizon, or ``"constant"``. One step knows no prediction yet.
        stop: Whose error is tested: that of the ``"horizon"`` (40), or of the ``"first_point"`` (16).

    Raises:
        InvalidInputError: A number is out of its range, or does not belong to the rule.
        UnknownNameError: There is no such rule, choice of Jacobians or stop.
    """

    rule: str = "condition"
    iterations: int = 10
    horizon: Annotated[int, Bounds(at_least=1)] = 2
    jacobians: Literal["predicted", "constant"] = "predicted"
    stop: Literal["horizon", "first_point"] = "horizon"

    name: ClassVar[str] = "mfapc"

    def __post_init__(self) -> None:
        super().__post_init__()
        predicted, whole = self.jacobians == "predicted", self.stop == "horizon"
        self._settle(points=self.horizon, predicted=predicted, whole_horizon=whole)

    @property
    def preview(self) -> int:
        """The n points that lie ahead."""
        return self.horizon
