"""Kernels: the cost of a joint path, the merit function in its place, and its quadratic model.

The tracking cost of a knot depends on its joint coordinates alone, the velocity cost of a block on those of its two
ends, joint by joint: the Hessian is block-tridiagonal, with diagonal blocks next to the diagonal. Changes of velocity,
where they cost something, couple three knots: see :func:`change`.
"""

from __future__ import annotations

from typing import NamedTuple

from baselines.solvers.receding_horizon.newton.second_order import second_order
from baselines.solvers.receding_horizon.newton.terms import (
    joint_limit_term,
    tracking_term,
    velocity_cost,
    velocity_derivatives,
    velocity_limit_term,
)
from baselines.solvers.receding_horizon.newton.workspace import joints_at
from ikgym.kernels import cost as cost_kernels
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.cost import P_X_INSIDE
from ikgym.kernels.jit import expanded, inlined, uncounted
from ikgym.kernels.kinematics import forward, forward_and_jacobian
from ikgym.kernels.limits import FASTEST, LOWER, UPPER

# All loops take their arrays out of the tuples first: numba counts references at each access, which costs more than the
# kinematics do.


class Values(NamedTuple):
    """Cost of a path.

    Attributes:
        merit: The merit function.
        true: The cost itself, limits apart.
        gap: The excess of the true cost over the one by the multipliers, with each limit's share: 0 where the
            multipliers are those of a minimum.
    """

    merit: float
    true: float
    gap: float


@inlined
def change(problem, path, k, j):
    """The change of velocity at the beginning of block ``k``, of joint ``j``, in [rad/s] or [m/s].

    Between a block of g steps and one of h steps the joint velocity changes by Δq̇, which is taken to need (g + h) / 2
    steps: Σ (Δq̇)² over these steps is Δq̇² / ((g + h) / 2), exact where both are one step long. The block before the
    first is the step that has passed.

    Returns:
        The change, its derivative by the knot at the block's end, that by the knot two before (both in [1/s]), and the
        weight of its square.
    """
    lengths, dt, start = problem.grid.length, problem.data.dt, problem.start
    here = path[k - 1, j] if k > 0 else start[j]
    by_end = 1.0 / (lengths[k] * dt)
    length, by_beginning, velocity = 1.0, 0.0, problem.qdot_before[j]
    if k > 0:
        length, by_beginning = lengths[k - 1], 1.0 / (lengths[k - 1] * dt)
        velocity = (here - (path[k - 2, j] if k > 1 else start[j])) * by_beginning
    weight = problem.rate_weight / (0.5 * (length + lengths[k]))
    return (path[k, j] - here) * by_end - velocity, by_end, by_beginning, weight


@uncounted
def rate_cost(problem, path):
    """The cost of a path's changes of velocity."""
    total = 0.0
    for k in range(path.shape[0]):
        for j in range(path.shape[1]):
            changed, _, _, weight = change(problem, path, k, j)
            total += weight * changed * changed
    return total


@uncounted
def add_rate_cost(problem, path, model):
    """Adds gradient and Hessian of :func:`rate_cost` to a quadratic model, whose ``far`` is set; gives the cost."""
    gradient, diagonal, coupling, far = model.gradient, model.diagonal, model.coupling, model.far
    total = 0.0
    for k in range(path.shape[0]):
        for j in range(path.shape[1]):
            changed, a, c, weight = change(problem, path, k, j)
            total += weight * changed * changed
            twice = 2.0 * weight
            gradient[k, j] += twice * changed * a
            diagonal[k, j, j] += twice * a * a
            far[k, j] = twice * a * c if k > 1 else 0.0
            if k > 0:
                gradient[k - 1, j] -= twice * changed * (a + c)
                diagonal[k - 1, j, j] += twice * (a + c) * (a + c)
                coupling[k, j] += twice * a * (a + c)
            if k > 1:
                gradient[k - 2, j] += twice * changed * c
                diagonal[k - 2, j, j] += twice * c * c
                coupling[k - 1, j] += twice * c * (a + c)
    return total


@expanded
def tracking_errors(problem, path, workspace):
    """The tracking errors at the knots that count, which the workspace keeps as well. Shape (at least K, e)."""
    chain, kind, nominal = problem.data.chain, problem.data.kind, problem.nominal
    at, tracking = problem.grid.at, problem.grid.tracking
    rotation, position, pose = workspace.knot.rotation, workspace.knot.position, workspace.knot.pose
    errors = workspace.errors
    for k in range(path.shape[0]):
        if tracking[k] != 0.0:
            forward(chain, joints_at(problem, path, k, workspace.knot), rotation, position)
            task_kernels.coordinates(kind, rotation, position, pose)
            task_kernels.error(kind, nominal[at[k] - 1], pose, errors[k])
    return errors


@uncounted
def true_cost(problem, path, workspace):
    """The cost of a path, from the same kernels as the environment's; limits apart."""
    data, grid, start, weights = problem.data, problem.grid, problem.start, problem.joint_weights
    cost, lengths, tracking, velocities = data.cost, grid.length, grid.tracking, grid.velocity
    errors = tracking_errors(problem, path, workspace)
    total = 0.0
    for k in range(path.shape[0]):
        if tracking[k] != 0.0:
            total += tracking[k] * cost_kernels.tracking(cost, errors[k])
        rate = 1.0 / (lengths[k] * data.dt)
        for j in range(path.shape[1]):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            total += velocities[k] * weights[j] * velocity_cost(cost, velocity)
    if problem.rate_weight > 0.0:
        total += rate_cost(problem, path)
    return total


@uncounted
def merit(problem, path, multipliers, workspace):
    """The smooth function that Newton's method minimises: the cost with its kinks and limits held by multipliers."""
    data, grid, start, weights = problem.data, problem.grid, problem.start, problem.joint_weights
    cost, lengths, tracking, velocities = data.cost, grid.length, grid.tracking, grid.velocity
    lower, upper, limits = data.limits[LOWER], data.limits[UPPER], data.limits[FASTEST]
    factor = workspace.knot.penalty_factor[0]
    errors = tracking_errors(problem, path, workspace)
    e, n = errors.shape[1], path.shape[1]
    total = 0.0
    for k in range(path.shape[0]):
        if tracking[k] != 0.0:
            part = 0.0
            for i in range(e):
                part += tracking_term(cost, errors[k, i], multipliers[k, i]).value
            total += tracking[k] * part
        rate = 1.0 / (lengths[k] * data.dt)
        for j in range(n):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            if velocities[k] != 0.0:
                total += velocities[k] * weights[j] * velocity_cost(cost, velocity)
            if multipliers[k, e + j] != 0.0 or abs(velocity) > limits[j]:
                total += velocity_limit_term(data, j, velocity, multipliers[k, e + j], factor).value
            if multipliers[k, e + n + j] != 0.0 or path[k, j] < lower[j] or path[k, j] > upper[j]:
                total += joint_limit_term(data, j, path[k, j], multipliers[k, e + n + j], factor).value
    if problem.rate_weight > 0.0:
        total += rate_cost(problem, path)
    return total


@uncounted
def linearise(problem, path, multipliers, advance, exact, workspace):
    """:func:`merit`, its gradient and its Hessian.

    Args:
        problem: See :mod:`newton`.
        path: See :mod:`newton`.
        multipliers: See :mod:`newton`.
        advance: Whether to replace λ₀ by the λ of the path first.
        exact: Whether the second derivatives of the error are wanted, too.
        workspace: See :mod:`newton`; its ``model`` receives gradient and Hessian.

    Returns:
        The :class:`Values` of the path.
    """
    data, grid, start, nominal = problem.data, problem.grid, problem.start, problem.nominal
    cost, kind, chain, dt, weights = data.cost, data.kind, data.chain, data.dt, problem.joint_weights
    at, lengths, tracking, velocities = grid.at, grid.length, grid.tracking, grid.velocity
    knot, model = workspace.knot, workspace.model
    rotation, position, geometric, pose = knot.rotation, knot.position, knot.geometric, knot.pose
    error, jacobian, error_jacobian, by_error = knot.error, knot.jacobian, knot.error_jacobian, knot.gradient
    lower, upper, limits = data.limits[LOWER], data.limits[UPPER], data.limits[FASTEST]
    gradient, diagonal, second, coupling = model.gradient, model.diagonal, model.second, model.coupling
    factor = knot.penalty_factor[0]
    e, n = error.shape[0], path.shape[1]
    total = true = gap = 0.0
    for k in range(path.shape[0]):
        for a in range(n):
            gradient[k, a] = 0.0
            for b in range(a + 1):
                diagonal[k, a, b] = 0.0
        weight = tracking[k]
        if weight != 0.0:
            forward_and_jacobian(chain, joints_at(problem, path, k, knot), rotation, position, geometric)
            task_kernels.coordinates(kind, rotation, position, pose)
            task_kernels.error(kind, nominal[at[k] - 1], pose, error)
            task_kernels.jacobian(kind, rotation, geometric, jacobian)
            task_kernels.error_jacobian(kind, nominal[at[k] - 1], pose, error, jacobian, error_jacobian)
            for i in range(e):
                if advance:
                    multipliers[k, i] = tracking_term(cost, error[i], multipliers[k, i]).multiplier
                term = tracking_term(cost, error[i], multipliers[k, i])
                total += weight * term.value
                true += weight * cost_kernels.value(error[i], cost.delta_x, P_X_INSIDE, cost.p_x)
                gap += weight * term.gap
                by_error[i] = weight * term.gradient
                for a in range(n):
                    gradient[k, a] += by_error[i] * error_jacobian[i, a]
                    curved = weight * term.curvature * error_jacobian[i, a]
                    for b in range(a + 1):
                        diagonal[k, a, b] += curved * error_jacobian[i, b]
        if exact:
            if weight != 0.0:
                second_order(kind, knot, second[k])
            else:
                second[k] = 0.0
        rate = 1.0 / (lengths[k] * dt)
        for j in range(n):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            by_velocity = by_velocity_twice = 0.0
            if velocities[k] != 0.0:
                count = velocities[k] * weights[j]
                value = count * velocity_cost(cost, velocity)
                total += value
                true += value
                first, twice = velocity_derivatives(cost, velocity)
                by_velocity, by_velocity_twice = count * first, count * twice
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
    if problem.rate_weight > 0.0:
        value = add_rate_cost(problem, path, model)
        total += value
        true += value
    return Values(total, true, gap)
