"""Receding horizon the traditional way: states, Lagrange multipliers and the reduced gradient (Varga 2021, eq. 3-4)."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, ClassVar

import numpy as np

from baselines.solvers.receding_horizon.descent import (
    DIVERGED,
    GOES_ON,
    adapt_alpha,
    squares,
    stop_if_diverged,
    stop_test,
    take_step,
)
from baselines.solvers.receding_horizon.gradient import RecedingHorizonGradient
from baselines.solvers.receding_horizon.horizon import (
    analytic_state_gradient,
    difference_state_gradient,
    frame_workspace,
    roll_out,
)
from baselines.solvers.receding_horizon.task_constraints import (
    Unknowns,
    kinematic_errors,
    reduced_task_gradient,
    task_system,
)
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.limits import FASTEST
from ikgym.validation import Flag


@dataclasses.dataclass(frozen=True, eq=False)
class RecedingHorizonLagrange(RecedingHorizonGradient):
    """Minimises the cost of :class:`RecedingHorizonGradient` under the constraints that the other eliminates.

    At each step the multipliers are so chosen that the constraints c(i) stagnate along the reduced gradient
    g = ∇Φ + Σ λ(i) ∇c(i) (eq. 4): with A = ∂c they solve A Aᵀ λ = −A ∇Φ. The step is −α g; α, the stop test and the
    warm start are as in the plain method, with the norm of g.

    With ``states`` the unknowns are those of eq. 3 with the kinematics of section III: the task coordinates
    X(2) … X(HL), the joint coordinates q(2) … q(HL) and the velocities q̇(1) … q̇(HL-1), under the constraints
    X(i) = F(q(i)) and (q(i+1) − q(i))/Δt = q̇(i). The former are not linear, so that the system of the multipliers, of
    (HL-1)(e + n) rows, is another at each step. The paper finds a first feasible point by Newton–Raphson; as the
    velocities are free, that is one Euler roll-out of them. On the way the constraints hold to first order, as in the
    paper, and X ends off F(q): by at most 1e-5 m in 230 periods of the fast trajectory, and mostly far less.

    Without, X is eliminated, the constraints left are linear, and A Aᵀ is tridiagonal, the same for all joints and
    steps.

    **Against the plain method.** g is ∇Φ projected onto the kernel of A, the velocities' part of it is
    M⁻¹ ∂Φ/∂q̇ with the plain gradient ∂Φ/∂q̇ along the constraints and ‖g‖² = (∂Φ/∂q̇)ᵀ M⁻¹ ∂Φ/∂q̇. Here
    M = I + Δt² LᵀL, L the lower triangle of ones, and CᵀC besides with ``states``, C the derivative of X by q̇. So an
    iterate equals the plain one preconditioned by M⁻¹: without ``states`` exactly up to rounding, with analytic
    gradients and with differences (taken as Δt δ in the joint coordinates), with ``states`` up to the error of X. It
    equals the plain one itself only to the order Δt² HL², or ‖C‖²: M is nearly I because a state counts, in rad or m,
    as much as a velocity in rad/s. Differences of that size can change which way α goes, where two norms are nearly
    equal; the paths then separate for a while. Where Δt is 1 (``zhang3-helix``), M is far from I, and these are
    different methods.

    Args:
        problem: The scenario as the policy knows it.
        horizon: HL; see :class:`RecedingHorizonGradient` for this and all that follow.
        tolerance: μ, the norm of the reduced gradient below which the descent stops.
        iterations: Most steps of one descent.
        alpha_min: Smallest α.
        alpha_max: Largest α.
        alpha_factor: Factor by which α grows or shrinks. At least 1.
        alpha_start: ``"restart"`` or ``"kept"``.
        warm_start: ``"unshifted"`` or ``"shifted"``.
        gradient: ``"finite_difference"`` or ``"analytic"``.
        difference: The finite difference δ of the joint velocities, from 1e-9 to 1; Δt δ is that of all coordinates.
        joint_weights: See :class:`RecedingHorizonGradient`.
        states: Whether the task coordinates are unknowns, as in the paper, or are eliminated.

    Raises:
        InvalidInputError: A parameter is out of its range.
        UnknownNameError: There is no such gradient, start of α or warm start.
    """

    states: Flag = False

    name: ClassVar[str] = "rhc_lagrange"

    def _descend(self) -> Any:
        """See :class:`RecedingHorizonGradient`."""
        return functools.partial(reduce_rows, self.states)


@kernel
def reduce_rows(with_tasks, data, settings, q, nominal, memory, status, iterations):
    """Descent along the reduced gradient row by row; ``with_tasks`` says whether the task coordinates are unknowns.

    Other arguments are those of :func:`gradient.descend_rows`.
    """
    alpha, difference, dt, (_, steps, n) = memory.alpha, settings.delta, data.model.dt, memory.plan.shape
    e = frame_workspace(data.model.kind, nominal[0])[3].shape[0] if with_tasks else 0
    errors, by_errors = np.empty((steps, e)), np.empty((steps, e))
    states, by_q, by_qdot = np.empty((steps, n)), np.empty((steps, n)), np.empty((steps, n))
    diagonal, ratio, multipliers = np.empty(steps), np.empty(steps), np.empty((steps, n))
    factorise(dt, diagonal, ratio)
    system = task_system(steps, e, n if with_tasks else 0)
    for row in range(q.shape[0]):
        qdot, step = memory.plan[row], 0
        roll_out(dt, q[row], qdot, states)
        if with_tasks:
            kinematic_errors(data, nominal[row], states, errors)
        first_value = last_norm = 0.0
        while True:
            if with_tasks:
                x, gradient = Unknowns(errors, states, qdot), Unknowns(by_errors, by_q, by_qdot)
                value = reduced_task_gradient(data, nominal[row], difference, x, system, gradient)
            else:
                if difference > 0.0:
                    value = difference_state_gradient(data, nominal[row], states, qdot, difference, by_q, by_qdot)
                else:
                    value = analytic_state_gradient(data, nominal[row], states, qdot, by_q, by_qdot)
                reduce_gradient(dt, diagonal, ratio, multipliers, by_q, by_qdot)
            norm = np.sqrt(squares(by_errors) + squares(by_q) + squares(by_qdot))
            if step == 0:
                first_value = value
            status[row] = stop_test(value, norm, settings, step)
            if status[row] != GOES_ON:
                break
            alpha[row] = adapt_alpha(alpha[row], norm, last_norm, settings)
            last_norm = norm
            take_step(errors, alpha[row], by_errors)
            take_step(states, alpha[row], by_q)
            take_step(qdot, alpha[row], by_qdot)
            step += 1
        iterations[row] = step
        status[row] = stop_if_diverged(status[row], value, first_value, data.model.limits[FASTEST], qdot)
        if status[row] == DIVERGED:
            alpha[row] = settings.alpha_min


@inner
def factorise(dt, diagonal, ratio):
    """L D Lᵀ of Δt² A Aᵀ of one joint, which has 1 + Δt², then 2 + Δt² on its diagonal and −1 next to it.

    ``diagonal`` receives D, ``ratio`` the entries of L below its diagonal of ones, the first of no use; (HL - 1,).
    """
    for i in range(diagonal.shape[0]):
        diagonal[i] = (1.0 if i == 0 else 2.0) + dt * dt
        ratio[i] = 0.0
        if i > 0:
            ratio[i] = -1.0 / diagonal[i - 1]
            diagonal[i] += ratio[i]


@inner
def reduce_gradient(dt, diagonal, ratio, multipliers, by_q, by_qdot):
    """Turns ∇Φ into the reduced gradient, along which no constraint changes.

    ``diagonal`` and ``ratio`` are D and L of :func:`factorise`, ``multipliers`` receives λ(1) … λ(HL - 1), and ``by_q``
    and ``by_qdot`` are ∂Φ/∂q(2 … HL) and ∂Φ/∂q̇(1 … HL - 1), changed in place. Shapes (HL - 1, n).
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
