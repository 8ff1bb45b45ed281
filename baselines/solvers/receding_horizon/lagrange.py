"""Receding horizon the traditional way: states, Lagrange multipliers and the reduced gradient (Varga 2021, eq. 3-4)."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from baselines.solvers.receding_horizon.descent import DIVERGED, GOES_ON, adapted, stop_if_diverged, stop_test
from baselines.solvers.receding_horizon.gradient import RecedingHorizonGradient
from baselines.solvers.receding_horizon.horizon import analytic_state_gradient, difference_state_gradient
from ikgym.jit import kernel


@dataclasses.dataclass(frozen=True, eq=False)
class RecedingHorizonLagrange(RecedingHorizonGradient):
    """Minimises the cost of :class:`RecedingHorizonGradient` under the constraints that the other eliminates.

    Variables are the states q(2) … q(HL) and the velocities q̇(1) … q̇(HL-1), constraints
    c(i) = (q(i+1) − q(i))/Δt − q̇(i) = 0 (eq. 3 with eq. 5). At each step the multipliers are so chosen that the
    constraints stagnate along the reduced gradient g = ∇Φ + Σ λ(i) ∇c(i) (eq. 4): with A = ∂c they solve
    A Aᵀ λ = −A ∇Φ, a tridiagonal system, the same for all joints. The step is −α g; α, the stop test and the warm
    start are as in the plain method, with the norm of g. The paper finds a first feasible point by Newton–Raphson;
    the constraints being linear, that is one Euler roll-out of the velocities.

    **Against the plain method.** g is ∇Φ projected onto the kernel of A, the velocities' part of it is
    M⁻¹ ∂Φ/∂q̇ with the plain gradient ∂Φ/∂q̇ along the constraints and M = I + Δt² LᵀL, L the lower triangle of
    ones; ‖g‖² = (∂Φ/∂q̇)ᵀ M⁻¹ ∂Φ/∂q̇. So an iterate equals the plain one preconditioned by M⁻¹, exactly but for
    rounding, with analytic gradients and with differences (taken as Δt δ in the states). It equals the plain one
    itself only to the order Δt² HL²: M is nearly I because a state counts, in rad, as much as a velocity in rad/s.
    Differences of that size can change which way α goes, where two norms are nearly equal; the paths then separate
    for a while. Where Δt is 1 (``zhang3-helix``), M is far from I and the two are different methods.

    Args:
        problem: What the policy is told of the scenario.
        horizon: HL; see :class:`RecedingHorizonGradient` for this and all that follow.
        tolerance: μ, the norm of the reduced gradient below which the descent stops.
        iterations: Most steps of one descent.
        alpha_min: Smallest α.
        alpha_max: Largest α.
        alpha_factor: By what α grows or shrinks. At least 1.
        gradient: ``"finite_difference"`` or ``"analytic"``.
        difference: The finite difference δ of the joint velocities, from 1e-9 to 1; Δt δ is that of the states.

    Raises:
        InvalidInputError: A parameter is out of its range.
        UnknownNameError: There is no such gradient.
    """

    name: ClassVar[str] = "rhc_lagrange"

    def _descend(self) -> Any:
        """See :class:`RecedingHorizonGradient`."""
        return reduce_rows

    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """A gradient before each step and one for the last test; the system of the multipliers is factorised once."""
        stages, joints, gradients = self.horizon - 1, self.problem.model.joints, iterations + 1
        if self.gradient == "analytic":
            return 0, gradients * stages, 1, 0
        # A difference in a state moves that grid point alone.
        return gradients * stages * (1 + joints), 0, 1, 0


@kernel
def reduce_rows(data, settings, q, nominal, memory, status, iterations):
    """Descent along the reduced gradient row by row.

    Args:
        data: The :class:`ProblemData`.
        settings: :class:`DescentSettings`.
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        nominal: Nominal task coordinates ahead. Shape (B, at least HL - 1, m).
        memory: :class:`DescentMemory`, changed in place.
        status: Receives values of :class:`Status`. Shape (B,).
        iterations: Receives the steps made. Shape (B,).
    """
    plan, alpha, difference, dt = memory.plan, memory.alpha, settings.difference, data.dt
    steps, n = plan.shape[1:]
    states, by_q, by_qdot = np.empty((steps, n)), np.empty((steps, n)), np.empty((steps, n))
    diagonal, ratio, multipliers = np.empty(steps), np.empty(steps), np.empty((steps, n))
    factorise(dt, diagonal, ratio)
    for row in range(plan.shape[0]):
        qdot, step = plan[row], 0
        for i in range(steps):
            for j in range(n):
                states[i, j] = (states[i - 1, j] if i > 0 else q[row, j]) + dt * qdot[i, j]  # eq. 5
        first_value = last_norm = 0.0
        while True:
            if difference > 0.0:
                value = difference_state_gradient(data, nominal[row], states, qdot, difference, by_q, by_qdot)
            else:
                value = analytic_state_gradient(data, nominal[row], states, qdot, by_q, by_qdot)
            reduce_gradient(dt, diagonal, ratio, multipliers, by_q, by_qdot)
            norm = np.sqrt(np.sum(by_q * by_q) + np.sum(by_qdot * by_qdot))
            if step == 0:
                first_value = value
            status[row] = stop_test(value, norm, settings, step)
            if status[row] != GOES_ON:
                break
            alpha[row] = adapted(alpha[row], norm, last_norm, settings)
            last_norm = norm
            for i in range(steps):
                for j in range(n):
                    states[i, j] -= alpha[row] * by_q[i, j]
                    qdot[i, j] -= alpha[row] * by_qdot[i, j]
            step += 1
        iterations[row] = step
        status[row] = stop_if_diverged(status[row], value, first_value, data.velocity_limit, qdot)
        if status[row] == DIVERGED:
            alpha[row] = settings.alpha_min


@kernel
def factorise(dt, diagonal, ratio):
    """L D Lᵀ of Δt² A Aᵀ of one joint, which has 1 + Δt², then 2 + Δt² on its diagonal and −1 beside it.

    Args:
        dt: Δt in [s].
        diagonal: Receives D. Shape (HL - 1,).
        ratio: Receives the entries of L below its diagonal of ones, the first of no use. Shape (HL - 1,).
    """
    for i in range(diagonal.shape[0]):
        diagonal[i] = (1.0 if i == 0 else 2.0) + dt * dt
        ratio[i] = 0.0
        if i > 0:
            ratio[i] = -1.0 / diagonal[i - 1]
            diagonal[i] += ratio[i]


@kernel
def reduce_gradient(dt, diagonal, ratio, multipliers, by_q, by_qdot):
    """Turns ∇Φ into the reduced gradient, along which no constraint changes.

    Args:
        dt: Δt in [s].
        diagonal: D of :func:`factorise`. Shape (HL - 1,).
        ratio: L of :func:`factorise`. Shape (HL - 1,).
        multipliers: Receives λ(1) … λ(HL - 1). Shape (HL - 1, n).
        by_q: ∂Φ/∂q(2 … HL), changed in place. Shape (HL - 1, n).
        by_qdot: ∂Φ/∂q̇(1 … HL - 1), changed in place. Shape (HL - 1, n).
    """
    steps, n = by_q.shape
    for j in range(n):
        for i in range(steps):
            # -Δt² A ∇Φ, and the forward substitution.
            multipliers[i, j] = dt * (dt * by_qdot[i, j] - by_q[i, j])
            if i > 0:
                multipliers[i, j] += dt * by_q[i - 1, j] - ratio[i] * multipliers[i - 1, j]
        for i in range(steps - 1, -1, -1):
            multipliers[i, j] /= diagonal[i]
            if i + 1 < steps:
                multipliers[i, j] -= ratio[i + 1] * multipliers[i + 1, j]
        for i in range(steps):
            by_q[i, j] += (multipliers[i, j] - (multipliers[i + 1, j] if i + 1 < steps else 0.0)) / dt
            by_qdot[i, j] -= multipliers[i, j]
