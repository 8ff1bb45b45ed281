"""Model-free adaptive control, which is the iteration of Levenberg and Marquardt (Zhang 2020, section III)."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

from baselines.solvers.levenberg_marquardt.base import DampedIteration


@dataclasses.dataclass(frozen=True, eq=False)
class ModelFreeAdaptiveControl(DampedIteration):
    """Goes to the next nominal point by damped least squares, again and again (eq. 11-17).

    At each period the model is iterated from the present joint coordinates:
    ``Δq_(i) = Jᵀ (J Jᵀ + λ_(i) I)⁻¹ e(y*(k+1), F(q_(i-1)))`` until ‖e‖ ≤ δ, the error being that of the task: for
    ``pose`` the rotation vector replaces the printed arccos, which is 0/0 near 0. The printed (13) inverts
    JᵀJ + λ I; the form in the small space is the same and does not need n² numbers where J is flat.

    Statuses: ``converged`` where the model meets δ; ``iteration_limit`` where it does not, as for a point out of
    reach; ``rank_deficient`` where it does not and J had lost rank with a λ of 0, or too small to count, the
    directions lost being left out; ``diverged`` where the iterates are no numbers, or lead away from the point faster
    than the velocity limit: the arm is stopped for one step. The printed (14) takes back no bad step: out of reach,
    where λ falls while the Jacobian loses rank, it does not converge, while ``sugihara`` does.

    For a ramp of velocity v per period one step with a constant J leaves the error U diag(λ/σ²) Uᵀ v (eq. 10).

    Args:
        problem: The scenario as the policy knows it.
        rule: The rule for λ; it and the ten numbers behind it are those of :class:`DampedIteration`.
        tolerance: δ, norm of the error at which the iteration stops, in the units of the task, [m] and [rad].
        iterations: N_up, most iterations of one period.
        one_step: Whether to apply the controller (5) once to the measured pose; δ and N_up do not matter then, and
            the status is ``applied`` where J has full rank.

    Raises:
        InvalidInputError: A number is out of its range, or does not belong to the rule.
        UnknownNameError: There is no such rule.
    """

    rule: str = "error_ratio"

    name: ClassVar[str] = "mfac"
