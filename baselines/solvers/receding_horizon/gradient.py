"""Receding horizon by gradient descent, without Lagrange multipliers (Varga, Issa, Horváth, Tar 2021)."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from baselines.policy import Batch, Memory, Solution, SolverPolicy
from baselines.policy.compiled import derived, kernel_fields, named_tuple
from baselines.solvers.receding_horizon.descent import (
    DIVERGED,
    GOES_ON,
    DescentMemory,
    adapt_alpha,
    squares,
    stop_if_diverged,
    stop_test,
    take_step,
)
from baselines.solvers.receding_horizon.horizon import HorizonModel, analytic_gradient, difference_gradient
from baselines.solvers.resolved_rate.base import relative_weights
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.jit import kernel
from ikgym.kernels.limits import FASTEST
from ikgym.validation import Bounds, FloatArray

# Smaller ones drown in the rounding of the states, which they change by Δt times as much.
SMALLEST_DIFFERENCE = 1e-9


@dataclasses.dataclass(frozen=True, eq=False)
class RecedingHorizonGradient(SolverPolicy):
    """Minimises the cost over a short horizon by gradient descent with an adaptive step (section III and IV).

    The free variables are the HL - 1 joint velocities of the horizon; the first is applied, and all of them are the
    start of the next horizon. Before each step the norm of the gradient is tested against μ. The step α grows by a
    factor where the norm fell and shrinks by it where the norm rose, within its bounds.

    The paper does not say whether α starts anew in each control period or is kept, nor whether the warm start is
    shifted; ``alpha_start`` and ``warm_start`` choose. With the printed bounds of α and the warm start unshifted, the
    descent that starts at `alpha_min` in each period does not diverge on the fast trajectory of the paper: α needs 60
    steps to its upper bound, and most descents take fewer. With α kept it diverges there, as α exceeds 2/λ_max of the
    Hessian on more than half of the path, and with the warm start shifted it does as well. On the same trajectory of
    the arm read literally (``varga7-literal-fast``) it diverges with either choice of both, and of the first twelve
    validation episodes of ``varga7-random`` one diverges as well. With ``alpha_start="kept", alpha_max=1e-4`` none of
    these does, in a third of the time.

    After a blow-up the difference of two huge costs is exactly 0, which naive code takes for convergence; here the
    status is ``diverged``, the arm is stopped for one step and the memory cleared.

    Args:
        problem: The scenario as the policy knows it.
        horizon: HL, the number of grid points with the present one. At least 2; HL - 1 steps must be shown ahead.
        tolerance: μ, the norm of the gradient below which the descent stops, in [s/rad] or [s/m].
        iterations: Most steps of one descent.
        alpha_min: Smallest α.
        alpha_max: Largest α.
        alpha_factor: Factor by which α grows or shrinks. At least 1.
        alpha_start: ``"restart"`` where α starts at `alpha_min` in each control period, ``"kept"`` where it continues
            from the period before.
        warm_start: ``"unshifted"`` where a descent starts from the last plan as it was, ``"shifted"`` where that moves
            on by one grid point, its last velocity being repeated.
        gradient: ``"finite_difference"`` as in the paper, or ``"analytic"``.
        difference: The finite difference of the joint velocities, in [rad/s] or [m/s]. From 1e-9 to 1.
        joint_weights: See :class:`rhc.RecedingHorizon`.

    Raises:
        InvalidInputError: A parameter is out of its range.
        UnknownNameError: There is no such gradient, start of α or warm start.
    """

    horizon: Annotated[int, Bounds(at_least=2)] = 3
    tolerance: Annotated[float, Bounds(at_least=0.0)] = 20.0
    iterations: Annotated[int, Bounds(at_least=1)] = 450
    alpha_min: Annotated[float, Bounds(above=0.0)] = 1e-8
    alpha_max: Annotated[float, Bounds(above=0.0)] = 5e-4
    alpha_factor: Annotated[float, Bounds(at_least=1.0)] = 1.2
    alpha_start: Literal["restart", "kept"] = "restart"
    warm_start: Literal["unshifted", "shifted"] = "unshifted"
    gradient: Literal["finite_difference", "analytic"] = "finite_difference"
    difference: Annotated[float, Bounds(at_least=SMALLEST_DIFFERENCE, at_most=1.0)] = 1e-3
    joint_weights: float | Sequence[float] = 1.0
    #: These in units of the smallest one. Shape (n,).
    weights: FloatArray = dataclasses.field(init=False, repr=False)
    #: The finite difference; 0 for analytic gradients.
    delta: float = derived()

    name: ClassVar[str] = "rhc_gradient"
    grain: ClassVar[int] = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.alpha_max < self.alpha_min:
            raise InvalidInputError(
                f"alpha_max: expected at least alpha_min = {self.alpha_min:g}, got {self.alpha_max:g}."
            )
        weights = relative_weights("joint_weights", self.joint_weights, self.problem.model.joints)
        self._settle(weights=weights, delta=self.difference if self.gradient == "finite_difference" else 0.0)

    @property
    def preview(self) -> int:
        """Grid points 2 … HL lie ahead."""
        return self.horizon - 1

    def memory(self, rows: int) -> DescentMemory:
        """A plan at rest, and the smallest α; see :class:`DescentMemory`."""
        plan = np.zeros((rows, self.horizon - 1, self.problem.model.joints))
        return DescentMemory(plan, np.full(rows, self.alpha_min))

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        changed = self._start(DescentMemory(*memory))
        status, iterations = np.empty((2, len(batch.q)), dtype=np.int64)
        self._descend()(*self._constants, batch.q, batch.nominal, changed, status, iterations)
        return Solution(changed.plan[:, 0].copy(), changed, status, iterations)

    def _start(self, memory: DescentMemory) -> DescentMemory:
        """Initial guesses of the descents of this control period."""
        plan, alpha = memory.plan.copy(), memory.alpha.copy()
        if self.warm_start == "shifted":
            plan[:, :-1] = memory.plan[:, 1:]
        if self.alpha_start == "restart":
            alpha[:] = self.alpha_min
        return DescentMemory(plan, alpha)

    @functools.cached_property
    def _constants(self) -> tuple[HorizonModel, Any]:
        """The arguments of the kernel that never change: the model, and the fields with a number."""
        names = kernel_fields(type(self))
        settings = named_tuple(names)(*(getattr(self, name) for name in names))
        return HorizonModel(self.problem.kernel_model, self.weights), settings

    def _descend(self) -> Any:
        """The kernel of the descent."""
        return descend_rows

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """The last α of the descent, as ``alpha``, of shape (B,)."""
        return {"alpha": DescentMemory(*self.memory_of(state)).alpha}


@kernel
def descend_rows(data, settings, q, nominal, memory, status, iterations):
    """Gradient descent row by row.

    Args:
        data: The :class:`horizon.HorizonModel`.
        settings: The fields of :class:`RecedingHorizonGradient` with a number.
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        nominal: Nominal task coordinates ahead. Shape (B, at least HL - 1, m).
        memory: :class:`DescentMemory`, changed in place.
        status: Receives values of :class:`Status`. Shape (B,).
        iterations: Receives the steps made. Shape (B,).
    """
    plan, alpha, difference = memory.plan, memory.alpha, settings.delta
    gradient = np.empty(plan.shape[1:])
    for row in range(plan.shape[0]):
        qdot, step = plan[row], 0
        first_value = last_norm = 0.0
        while True:
            if difference > 0.0:
                value = difference_gradient(data, q[row], nominal[row], qdot, difference, gradient)
            else:
                value = analytic_gradient(data, q[row], nominal[row], qdot, gradient)
            norm = np.sqrt(squares(gradient))
            if step == 0:
                first_value = value
            status[row] = stop_test(value, norm, settings, step)
            if status[row] != GOES_ON:
                break
            alpha[row] = adapt_alpha(alpha[row], norm, last_norm, settings)
            last_norm = norm
            take_step(qdot, alpha[row], gradient)
            step += 1
        iterations[row] = step
        status[row] = stop_if_diverged(status[row], value, first_value, data.model.limits[FASTEST], qdot)
        if status[row] == DIVERGED:
            alpha[row] = settings.alpha_min
