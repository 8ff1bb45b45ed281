"""Kernels: the cost of a joint path, the merit function that stands for it, and its quadratic model.

The tracking cost of a knot depends on its own joint coordinates alone, the velocity cost of a block on those of its two
ends, joint by joint: the Hessian is block-tridiagonal, with diagonal blocks beside the diagonal.
"""

from __future__ import annotations

from typing import NamedTuple

from baselines.solvers.receding_horizon.newton.second_order import second_order
from baselines.solvers.receding_horizon.newton.terms import (
    joint_limit_term,
    tracking_error,
    tracking_term,
    velocity_cost,
    velocity_curvature,
    velocity_gradient,
    velocity_limit_term,
)
from ikgym import cost_kernels, task_kernels
from ikgym.cost_kernels import P_X_INSIDE
from ikgym.jit import inlined, kernel
from ikgym.kinematics import forward, forward_and_jacobian

# All loops take their arrays out of the tuples first: numba counts references at each access, which costs more than the
# kinematics do.


class Values(NamedTuple):
    """What a path costs.

    Attributes:
        merit: The merit function.
        true: The cost itself, limits apart.
        gap: By how much the true cost exceeds what the multipliers say, with each limit's share: 0 where the
            multipliers are those of a minimum.
    """

    merit: float
    true: float
    gap: float


@kernel
def true_cost(problem, path, workspace):
    """The cost of a path, from the same kernels as the environment's; limits apart.

    Args:
        problem: A :class:`workspace.PathProblem` of K knots.
        path: Joint coordinates at the knots in [rad] or [m]. Shape (K, n).
        workspace: A :class:`workspace.KnotWorkspace`.
    """
    data, grid, start, nominal = problem.data, problem.grid, problem.start, problem.nominal
    cost, kind, chain, dt = data.cost, data.kind, data.chain, data.dt
    at, lengths, tracking, velocities = grid.at, grid.length, grid.tracking, grid.velocity
    rotation, position, error = workspace.rotation, workspace.position, workspace.error
    total = 0.0
    for k in range(path.shape[0]):
        if tracking[k] != 0.0:
            forward(chain, path[k], rotation, position)
            tracking_error(kind, nominal[at[k] - 1], workspace)
            total += tracking[k] * cost_kernels.tracking(cost, error)
        rate = 1.0 / (lengths[k] * dt)
        for j in range(path.shape[1]):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            total += velocities[k] * velocity_cost(cost, velocity)
    return total


@kernel
def merit(problem, path, multipliers, workspace):
    """The smooth function that Newton's method minimises: the cost with its kinks and limits held by multipliers.

    Args:
        problem: A :class:`workspace.PathProblem` of K knots.
        path: Joint coordinates at the knots in [rad] or [m]. Shape (K, n).
        multipliers: λ₀ of each knot: of its e errors, its n velocities and its n joint coordinates.
            Shape (K, e + 2 n).
        workspace: A :class:`workspace.KnotWorkspace`.
    """
    data, grid, start, nominal = problem.data, problem.grid, problem.start, problem.nominal
    cost, kind, chain, dt = data.cost, data.kind, data.chain, data.dt
    at, lengths, tracking, velocities = grid.at, grid.length, grid.tracking, grid.velocity
    rotation, position, error = workspace.rotation, workspace.position, workspace.error
    limits, lower, upper = data.velocity_limit, data.lower, data.upper
    factor = workspace.penalty_factor[0]
    e, n = error.shape[0], path.shape[1]
    total = 0.0
    for k in range(path.shape[0]):
        if tracking[k] != 0.0:
            forward(chain, path[k], rotation, position)
            tracking_error(kind, nominal[at[k] - 1], workspace)
            part = 0.0
            for i in range(e):
                part += tracking_term(cost, error[i], multipliers[k, i]).value
            total += tracking[k] * part
        rate = 1.0 / (lengths[k] * dt)
        for j in range(n):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            if velocities[k] != 0.0:
                total += velocities[k] * velocity_cost(cost, velocity)
            if multipliers[k, e + j] != 0.0 or abs(velocity) > limits[j]:
                total += velocity_limit_term(data, j, velocity, multipliers[k, e + j], factor).value
            if multipliers[k, e + n + j] != 0.0 or path[k, j] < lower[j] or path[k, j] > upper[j]:
                total += joint_limit_term(data, j, path[k, j], multipliers[k, e + n + j], factor).value
    return total


@kernel
def linearise(problem, path, multipliers, advance, exact, workspace, model):
    """:func:`merit`, its gradient and its Hessian.

    Args:
        problem: A :class:`workspace.PathProblem` of K knots.
        path: Joint coordinates at the knots in [rad] or [m]. Shape (K, n).
        multipliers: λ₀, see :func:`merit`. Shape (K, e + 2 n).
        advance: Whether to replace λ₀ by the λ of the path first.
        exact: Whether the second derivatives of the error are wanted, too.
        workspace: A :class:`workspace.KnotWorkspace`.
        model: A :class:`workspace.QuadraticModel`, which receives gradient and Hessian.

    Returns:
        The :class:`Values` of the path.
    """
    data, grid, start, nominal = problem.data, problem.grid, problem.start, problem.nominal
    cost, kind, chain, dt = data.cost, data.kind, data.chain, data.dt
    at, lengths, tracking, velocities = grid.at, grid.length, grid.tracking, grid.velocity
    rotation, position, geometric = workspace.rotation, workspace.position, workspace.geometric
    error, jacobian, error_jacobian = workspace.error, workspace.jacobian, workspace.error_jacobian
    limits, lower, upper = data.velocity_limit, data.lower, data.upper
    gradient, diagonal, second, coupling = model.gradient, model.diagonal, model.second, model.coupling
    by_error, by_error_twice = workspace.gradient, workspace.curvature
    factor = workspace.penalty_factor[0]
    e, n = error.shape[0], path.shape[1]
    values = Values(0.0, 0.0, 0.0)
    for k in range(path.shape[0]):
        for a in range(n):
            gradient[k, a] = 0.0
            for b in range(a + 1):
                diagonal[k, a, b] = 0.0
        if tracking[k] != 0.0:
            forward_and_jacobian(chain, path[k], rotation, position, geometric)
            tracking_error(kind, nominal[at[k] - 1], workspace)
            task_kernels.jacobian(kind, rotation, geometric, jacobian)
            task_kernels.error_jacobian(kind, error, jacobian, error_jacobian)
            if advance:
                for i in range(e):
                    multipliers[k, i] = tracking_term(cost, error[i], multipliers[k, i]).multiplier
            values = add_tracking(cost, tracking[k], error, multipliers[k], by_error, by_error_twice, values)
            add_gauss_newton(by_error, by_error_twice, error_jacobian, gradient[k], diagonal[k])
        if exact:
            if tracking[k] != 0.0:
                second_order(kind, workspace, second[k])
            else:
                second[k] = 0.0
        total, true, gap = values
        rate = 1.0 / (lengths[k] * dt)
        for j in range(n):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            by_velocity = by_velocity_twice = 0.0
            if velocities[k] != 0.0:
                value = velocities[k] * velocity_cost(cost, velocity)
                total += value
                true += value
                by_velocity = velocities[k] * velocity_gradient(cost, velocity)
                by_velocity_twice = velocities[k] * velocity_curvature(cost, velocity)
            held = e + j
            if multipliers[k, held] != 0.0 or abs(velocity) > limits[j]:
                if advance:
                    multipliers[k, held] = velocity_limit_term(
                        data, j, velocity, multipliers[k, held], factor
                    ).multiplier
                term = velocity_limit_term(data, j, velocity, multipliers[k, held], factor)
                total += term.value
                gap += abs(term.linear)
                by_velocity += term.multiplier
                by_velocity_twice += term.curvature
            by_velocity *= rate
            by_velocity_twice *= rate * rate
            coupling[k, j] = by_velocity_twice
            gradient[k, j] += by_velocity
            diagonal[k, j, j] += by_velocity_twice
            if k > 0:
                gradient[k - 1, j] -= by_velocity
                diagonal[k - 1, j, j] += by_velocity_twice
            held = e + n + j
            if multipliers[k, held] != 0.0 or path[k, j] < lower[j] or path[k, j] > upper[j]:
                if advance:
                    multipliers[k, held] = joint_limit_term(
                        data, j, path[k, j], multipliers[k, held], factor
                    ).multiplier
                term = joint_limit_term(data, j, path[k, j], multipliers[k, held], factor)
                total += term.value
                gap += abs(term.linear)
                gradient[k, j] += term.multiplier
                diagonal[k, j, j] += term.curvature
        values = Values(total, true, gap)
    return values


@inlined
def add_tracking(cost, weight, error, multipliers, gradient, curvature, values):
    """Adds the tracking cost of a knot.

    Args:
        cost: The cost's parameters.
        weight: How many stage costs the knot stands for.
        error: Its tracking error. Shape (e,).
        multipliers: λ₀ of its errors. Shape (at least e,).
        gradient: Receives the weighted derivatives by the error. Shape (e,).
        curvature: Receives the weighted second derivatives by the error. Shape (e,).
        values: The :class:`Values` so far.

    Returns:
        The :class:`Values` with this knot.
    """
    total, true, gap = values
    for i in range(error.shape[0]):
        term = tracking_term(cost, error[i], multipliers[i])
        total += weight * term.value
        true += weight * cost_kernels.value(error[i], cost.delta_x, P_X_INSIDE, cost.p_x)
        gap += weight * term.gap
        gradient[i] = weight * term.gradient
        curvature[i] = weight * term.curvature
    return Values(total, true, gap)


@inlined
def add_gauss_newton(by_error, by_error_twice, error_jacobian, gradient, diagonal):
    """Adds the derivatives of a knot's tracking cost by its joint coordinates, Jᵀ g and the lower triangle of Jᵀ H J.

    Args:
        by_error: g. Shape (e,).
        by_error_twice: The diagonal of H. Shape (e,).
        error_jacobian: J. Shape (e, n).
        gradient: Shape (n,).
        diagonal: Shape (n, n).
    """
    for i in range(by_error.shape[0]):
        for a in range(gradient.shape[0]):
            gradient[a] += by_error[i] * error_jacobian[i, a]
            curved = by_error_twice[i] * error_jacobian[i, a]
            for b in range(a + 1):
                diagonal[a, b] += curved * error_jacobian[i, b]
