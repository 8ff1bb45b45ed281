"""Kernels of a horizon whose task coordinates are unknowns, with the kinematics as constraints (Varga 2021, eq. 3-4).

The task coordinates X(i) are here their errors E(i) = X^N(i) − X(i); for ``pose``, whose coordinates cannot be
changed one by one, as position error and rotation vector. The constraints of a stage are
q(i+1) − q(i) − Δt q̇(i) = 0 and E(i+1) − ε(q(i+1)) = 0, where ε is the error that the kinematics give.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.solvers.receding_horizon.horizon import (
    frame_workspace,
    linearise,
    tracking_error,
    velocity_cost,
    velocity_gradient,
)
from baselines.solvers.receding_horizon.newton.workspace import knot_workspace
from ikgym.kernels import cost as cost_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.kernels.linear_algebra import cholesky, cholesky_solve

Floats = npt.NDArray[np.float64]


class Unknowns(NamedTuple):
    """The unknowns of one arm's horizon, or derivatives by them.

    Attributes:
        errors: E at the second and later grid points. Shape (HL - 1, e), with e = 0 where they are eliminated.
        q: Joint coordinates at the second and later grid points. Shape (HL - 1, n).
        qdot: Joint velocities. Shape (HL - 1, n).
    """

    errors: Floats
    q: Floats
    qdot: Floats


class TaskSystem(NamedTuple):
    """Work space of the multipliers; s = (HL - 1)(n + e), a stage's n before its e.

    Attributes:
        jacobian: ∂ε/∂q of the grid points. Shape (HL - 1, e, n).
        gram: A Aᵀ, where A are the derivatives of the constraints by the unknowns. Shape (s, s).
        multipliers: λ. Shape (s,).
    """

    jacobian: Floats
    gram: Floats
    multipliers: Floats


@inner
def task_system(steps, e, n):
    """A :class:`TaskSystem` for numbers of stages, components of the error and joints."""
    s = steps * (n + e)
    return TaskSystem(np.empty((steps, e, n)), np.empty((s, s)), np.empty(s))


@inner
def kinematic_errors(data, nominal, q, errors):
    """ε(q); ``errors`` (HL - 1, e) receives it, other arguments as in :func:`analytic_task_gradient`."""
    workspace = frame_workspace(data.model.kind, nominal)
    for i in range(q.shape[0]):
        _error(data, nominal[i], q[i], workspace, errors[i])


@kernel
def _error(data, nominal, q, workspace, error):
    """ε of one grid point, see :func:`tracking_error`; a separate kernel, as when its time was measured."""
    tracking_error(data, nominal, q, workspace, error)


@inner
def reduced_task_gradient(data, nominal, difference, x, system, gradient):
    """The reduced gradient by all unknowns, and Φ, infinite where the system of the multipliers cannot be solved.

    Args:
        data: The :class:`horizon.HorizonModel`; limits do not count.
        nominal: Nominal coordinates of the second and later grid points. Shape (at least HL - 1, m).
        difference: The finite difference δ of the velocities, 0 for analytic derivatives.
        x: :class:`Unknowns`.
        system: :class:`TaskSystem`.
        gradient: :class:`Unknowns`, receives the reduced gradient.

    Returns:
        The cost.
    """
    if difference > 0.0:
        value = difference_task_gradient(data, nominal, x, difference, system.jacobian, gradient)
    else:
        value = analytic_task_gradient(data, nominal, x, system.jacobian, gradient)
    return value if reduce_task_gradient(data.model.dt, system, gradient) else np.inf


@inner
def analytic_task_gradient(data, nominal, x, jacobian, gradient):
    """∂Φ/∂E and ∂Φ/∂q̇ with all unknowns taken for independent, so that ∂Φ/∂q is 0; ∂ε/∂q, and Φ.

    ``jacobian`` receives ∂ε/∂q, of shape (HL - 1, e, n); other arguments as above. Gives the cost.
    """
    steps, n = x.q.shape
    workspace = knot_workspace(data.model.kind, nominal.shape[1], n)
    total = 0.0
    for i in range(steps):
        forward_and_jacobian(data.model.chain, x.q[i], workspace.rotation, workspace.position, workspace.geometric)
        linearise(data.model.kind, nominal[i], workspace)
        jacobian[i] = workspace.error_jacobian
        total += cost_kernels.tracking(data.model.cost, x.errors[i]) + velocity_cost(data, x.qdot[i])
        cost_kernels.tracking_gradient(data.model.cost, x.errors[i], gradient.errors[i])
        velocity_gradient(data, x.qdot[i], gradient.qdot[i])
    return total


@inner
def difference_task_gradient(data, nominal, x, delta, jacobian, gradient):
    """:func:`analytic_task_gradient` by forward differences: ``delta`` in q̇, Δt ``delta`` in E and q."""
    (steps, n), e, small = x.q.shape, x.errors.shape[1], data.model.dt * delta
    workspace, here, shifted = frame_workspace(data.model.kind, nominal), np.empty(e), np.empty(e)
    total = 0.0
    for i in range(steps):
        tracking = cost_kernels.tracking(data.model.cost, x.errors[i])
        velocity = velocity_cost(data, x.qdot[i])
        total += tracking + velocity
        for a in range(e):
            kept = x.errors[i, a]
            x.errors[i, a] = kept + small
            gradient.errors[i, a] = (cost_kernels.tracking(data.model.cost, x.errors[i]) - tracking) / small
            x.errors[i, a] = kept
        _error(data, nominal[i], x.q[i], workspace, here)
        for j in range(n):
            kept = x.q[i, j]
            x.q[i, j] = kept + small
            _error(data, nominal[i], x.q[i], workspace, shifted)
            x.q[i, j] = kept
            for a in range(e):
                jacobian[i, a, j] = (shifted[a] - here[a]) / small
            kept = x.qdot[i, j]
            x.qdot[i, j] = kept + delta
            gradient.qdot[i, j] = (velocity_cost(data, x.qdot[i]) - velocity) / delta
            x.qdot[i, j] = kept
    return total


@inner
def reduce_task_gradient(dt, system, gradient):
    """Turns ∇Φ into the reduced gradient ∇Φ + Aᵀλ, along which the constraints stagnate: A Aᵀ λ = −A ∇Φ.

    The :class:`TaskSystem` has ∂ε/∂q, the rest of it and the gradient are changed in place.

    Returns:
        False where the system cannot be solved, as numbers are not finite; then there is no reduced gradient.
    """
    (steps, e, n), jacobian, multipliers = system.jacobian.shape, system.jacobian, system.multipliers
    _assemble(dt, jacobian, system.gram)
    for i in range(steps):
        at = i * (n + e)
        for j in range(n):
            multipliers[at + j] = dt * gradient.qdot[i, j]
        for a in range(e):
            multipliers[at + n + a] = -gradient.errors[i, a]
    if not cholesky(system.gram):
        return False
    cholesky_solve(system.gram, multipliers)
    for i in range(steps):
        at = i * (n + e)
        for j in range(n):
            gradient.q[i, j] = multipliers[at + j]
            if i + 1 < steps:
                gradient.q[i, j] -= multipliers[at + n + e + j]
            for a in range(e):
                gradient.q[i, j] -= jacobian[i, a, j] * multipliers[at + n + a]
            gradient.qdot[i, j] -= dt * multipliers[at + j]
        for a in range(e):
            gradient.errors[i, a] += multipliers[at + n + a]
    return True


@inner
def _assemble(dt, jacobian, gram):
    """The lower triangle of A Aᵀ."""
    steps, e, n = jacobian.shape
    gram[:] = 0.0
    for i in range(steps):
        at, before = i * (n + e), (i - 1) * (n + e)
        for j in range(n):
            gram[at + j, at + j] = (1.0 if i == 0 else 2.0) + dt * dt
            if i > 0:
                gram[at + j, before + j] = -1.0
                for a in range(e):
                    gram[at + j, before + n + a] = jacobian[i - 1, a, j]
        for a in range(e):
            for j in range(n):
                gram[at + n + a, at + j] = -jacobian[i, a, j]
            for b in range(a + 1):
                total = 1.0 if a == b else 0.0
                for j in range(n):
                    total += jacobian[i, a, j] * jacobian[i, b, j]
                gram[at + n + a, at + n + b] = total
