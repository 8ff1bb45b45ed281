"""Receding horizon by gradient descent, without Lagrange multipliers (Varga, Issa, Horváth, Tar 2021)."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Solution, SolverPolicy
from baselines.solvers.receding_horizon.descent import GOES_ON, adapted, settle, stop_test
from baselines.solvers.receding_horizon.horizon import analytic_gradient, difference_gradient
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.jit import kernel
from ikgym.validation import FloatArray, number, whole_number

GRADIENTS = ("finite_difference", "analytic")


@dataclasses.dataclass(frozen=True, eq=False)
class RecedingHorizonGradient(SolverPolicy):
    """Minimises the cost over a short horizon by gradient descent with an adaptive step (section III and IV).

    The free variables are the HL - 1 joint velocities of the horizon; the first is applied, and all of them are the
    start of the next horizon, unshifted. Before each step the norm of the gradient is tested against μ. The step
    α grows by a factor where the norm fell and shrinks by it where the norm rose, within its bounds; it is kept
    from horizon to horizon.

    As printed, with ``alpha_max = 5e-4``, the descent diverges on the fast trajectory of the paper: on more than
    half of the path α exceeds 2/λ_max of the Hessian. After the blow-up the difference of two huge costs is
    exactly 0, which naive code takes for convergence; here the status is ``diverged``, the arm is stopped for one
    step and the memory cleared. The default is therefore ``alpha_max = 1e-4``.

    Args:
        problem: What the policy is told of the scenario.
        horizon: HL, the number of grid points with the present one. At least 2; HL - 1 steps must be shown ahead.
        tolerance: μ, the norm of the gradient below which the descent stops, in [s/rad] or [s/m].
        iterations: Most steps of one descent.
        alpha_min: Smallest α.
        alpha_max: Largest α.
        alpha_factor: By what α grows or shrinks. At least 1.
        gradient: ``"finite_difference"`` as in the paper, or ``"analytic"``.
        difference: The finite difference of the joint velocities, in [rad/s] or [m/s].

    Raises:
        InvalidInputError: A parameter is out of its range.
        UnknownNameError: There is no such gradient.
    """

    horizon: int = 3
    tolerance: float = 20.0
    iterations: int = 450
    alpha_min: float = 1e-8
    alpha_max: float = 1e-4
    alpha_factor: float = 1.2
    gradient: str = "finite_difference"
    difference: float = 1e-3

    name: ClassVar[str] = "rhc_gradient"
    grain: ClassVar[int] = 1

    def __post_init__(self) -> None:
        whole_number("horizon", self.horizon, at_least=2)
        whole_number("iterations", self.iterations, at_least=1)
        number("tolerance", self.tolerance, at_least=0.0)
        number("alpha_min", self.alpha_min, above=0.0)
        if number("alpha_max", self.alpha_max, above=0.0) < self.alpha_min:
            raise InvalidInputError(
                f"alpha_max: expected at least alpha_min = {self.alpha_min:g}, got {self.alpha_max:g}."
            )
        number("alpha_factor", self.alpha_factor, at_least=1.0)
        number("difference", self.difference, above=0.0)
        if self.gradient not in GRADIENTS:
            raise UnknownNameError("gradient", self.gradient, GRADIENTS)

    @property
    def preview(self) -> int:
        """Grid points 2 … HL lie ahead."""
        return self.horizon - 1

    def memory(self, rows: int) -> Memory:
        """The joint velocities of the horizon, of shape (B, HL - 1, n), and α, of shape (B,)."""
        return np.zeros((rows, self.horizon - 1, self.problem.model.joints)), np.full(rows, self.alpha_min)

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        problem = self.problem
        plan, alpha = memory[0].copy(), memory[1].copy()
        rows = len(plan)
        status, iterations = np.empty(rows, dtype=np.int64), np.empty(rows, dtype=np.int64)
        self._descend()(
            problem.model.chain,
            problem.task.kind,
            problem.cost.parameters,
            problem.dt,
            problem.velocity_limit,
            batch.q,
            batch.nominal,
            plan,
            alpha,
            self.tolerance,
            self.iterations,
            (self.alpha_min, self.alpha_max, self.alpha_factor),
            self.difference if self.gradient == "finite_difference" else 0.0,
            status,
            iterations,
        )
        return Solution(plan[:, 0].copy(), (plan, alpha), status, iterations)

    def _descend(self) -> Any:
        """The kernel of the descent."""
        return descend_rows

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """The step α that is kept for the next horizon, as ``alpha``, of shape (B,)."""
        return {"alpha": state[3]}

    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """A gradient before each step and one for the last test, over the HL - 1 stages of the horizon."""
        stages, joints, gradients = self.horizon - 1, self.problem.model.joints, iterations + 1
        if self.gradient == "analytic":
            return 0, gradients * stages, 0, 0
        # A velocity of the i-th stage moves that stage and all behind it.
        return gradients * (stages + joints * stages * (stages + 1) // 2), 0, 0, 0


@kernel
def descend_rows(
    chain,
    kind,
    cost,
    dt,
    limit,
    q,
    nominal,
    plan,
    alpha,
    tolerance,
    most,
    rule,
    difference,
    status,
    iterations,
):
    """Gradient descent row by row; ``plan`` (B, HL - 1, n) and ``alpha`` (B,) are changed in place."""
    gradient = np.empty(plan.shape[1:])
    for row in range(plan.shape[0]):
        qdot, step = plan[row], 0
        first_value = last_norm = 0.0
        while True:
            if difference > 0.0:
                value = difference_gradient(chain, kind, cost, dt, q[row], nominal[row], qdot, difference, gradient)
            else:
                value = analytic_gradient(chain, kind, cost, dt, q[row], nominal[row], qdot, gradient)
            norm = np.sqrt(np.sum(gradient * gradient))
            if step == 0:
                first_value = value
            status[row] = stop_test(value, norm, tolerance, step, most)
            if status[row] != GOES_ON:
                break
            alpha[row] = adapted(alpha[row], norm, last_norm, rule)
            last_norm = norm
            for i in range(qdot.shape[0]):
                for j in range(qdot.shape[1]):
                    qdot[i, j] -= alpha[row] * gradient[i, j]
            step += 1
        iterations[row] = step
        settle(status, value, first_value, limit, rule, row, qdot, alpha)
