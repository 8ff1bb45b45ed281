"""Kernels: the barrier function of a joint path, its cost with kinks and limits smoothed, and its quadratic model.

Limits of acceleration couple three knots, joint by joint: the Hessian is block-pentadiagonal.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from baselines.solvers.receding_horizon.newton.clearance import add_clearance, clearance_value
from baselines.solvers.receding_horizon.newton.cost import add_rate_cost, rate_cost, tracking_errors
from baselines.solvers.receding_horizon.newton.second_order import second_order
from baselines.solvers.receding_horizon.newton.terms import (
    Bounded,
    derivatives_without_kink,
    kink_steepness,
    one_side,
    smooth,
    velocity_cost,
    velocity_derivatives,
    without_kink,
)
from baselines.solvers.receding_horizon.newton.workspace import joints_at
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inlined, uncounted
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.kernels.limits import FASTEST, LOWER, UPPER

# Origin of the multipliers: from the gradients of the barriers, as they are, or by a step of this length at most.
ANEW, KEPT = -1.0, 0.0


class Barrier(NamedTuple):
    """Smoothness of the barrier function.

    Attributes:
        mu: μ, the barrier parameter, in [cost].
        limit_weight: w of the limits, in [cost].
    """

    mu: float
    limit_weight: float


@uncounted
def merit(problem, path, barrier, workspace):
    """The barrier function."""
    data, grid, start = problem.data, problem.grid, problem.start
    cost, dt, mu, weight = data.cost, data.dt, barrier.mu, barrier.limit_weight
    lengths, tracking, velocities, joint_weights = grid.length, grid.tracking, grid.velocity, problem.joint_weights
    lower, upper, limits, changes = data.limits[LOWER], data.limits[UPPER], data.limits[FASTEST], problem.change_limit
    errors, before = tracking_errors(problem, path, workspace), workspace.before
    (knots, n), e, steepness = path.shape, errors.shape[1], kink_steepness(cost)
    total = 0.0
    for k in range(knots):
        if tracking[k] != 0.0:
            part = 0.0
            for i in range(e):
                total += _kink_value(errors[k, i] / cost.delta_x, tracking[k] * steepness, mu)
                part += without_kink(cost, errors[k, i], steepness)
            total += tracking[k] * part
        rate, span = 1.0 / (lengths[k] * dt), change_steps(lengths, k)
        ends = problem.braking and k == knots - 1
        for j in range(n):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            change = velocity - (before[j] if k > 0 else problem.qdot_before[j])
            before[j], limit, most = velocity, limits[j], span * changes[j]
            way = braking_way(velocity, dt / changes[j]) if ends else 0.0
            if velocities[k] != 0.0:
                total += velocities[k] * joint_weights[j] * velocity_cost(cost, velocity)
            total += _value(velocity, -limit, limit, limit, weight, mu)
            total += _value(change, -most, most, most, weight, mu)
            total += _value(path[k, j] + way, lower[j], upper[j], dt * limit, weight, mu)
    if problem.rate_weight > 0.0:
        total += rate_cost(problem, path)
    return total + clearance_value(problem.clearance, problem, path, barrier, workspace)


@uncounted
def linearise(problem, path, barrier, advance, exact, workspace):
    """:func:`merit`, its gradient and its Hessian.

    Args:
        problem: See :mod:`newton`.
        path: See :mod:`newton`.
        barrier: :class:`Barrier`.
        advance: Length of the step that led here, by which the multipliers change; KEPT to leave them, ANEW to set
            them.
        exact: Whether the second derivatives of the error are wanted, too.
        workspace: See :mod:`newton`; its barriers and quadratic model are set.

    Returns:
        The barrier function.
    """
    knots, model, total = path.shape[0], workspace.model, 0.0
    for array in (model.gradient, model.coupling, model.far):
        array[:knots] = 0.0
    model.diagonal[:knots] = 0.0
    if problem.rate_weight > 0.0:
        total += add_rate_cost(problem, path, model)
    total += add_clearance(problem.clearance, problem, path, barrier, advance, workspace)
    total += _add_tracking(problem, path, barrier, advance, exact, workspace)
    return total + _add_motion(problem, path, barrier, advance, workspace)


@uncounted
def _add_tracking(problem, path, barrier, advance, exact, workspace):
    """Adds the tracking costs to the quadratic model; gives their value with the kinks smoothed."""
    data, nominal, at, tracking = problem.data, problem.nominal, problem.grid.at, problem.grid.tracking
    cost, kind, chain, mu = data.cost, data.kind, data.chain, barrier.mu
    knot, model, barriers = workspace.knot, workspace.model, workspace.barriers
    rotation, position, geometric, pose = knot.rotation, knot.position, knot.geometric, knot.pose
    error, jacobian, error_jacobian, by_error = knot.error, knot.jacobian, knot.error_jacobian, knot.gradient
    gradient, diagonal, second = model.gradient, model.diagonal, model.second
    delta, steepness, n, total = cost.delta_x, kink_steepness(cost), path.shape[1], 0.0
    for k in range(path.shape[0]):
        weight = tracking[k]
        if weight == 0.0:
            second[k] = 0.0
            continue
        forward_and_jacobian(chain, joints_at(problem, path, k, knot), rotation, position, geometric)
        task_kernels.coordinates(kind, rotation, position, pose)
        task_kernels.error(kind, nominal[at[k] - 1], pose, error)
        task_kernels.jacobian(kind, rotation, geometric, jacobian)
        task_kernels.error_jacobian(kind, nominal[at[k] - 1], pose, error, jacobian, error_jacobian)
        for i in range(error.shape[0]):
            total += weight * without_kink(cost, error[i], steepness)
            first, curved = derivatives_without_kink(cost, error[i], steepness)
            first, curved = weight * first, weight * curved
            if steepness > 0.0:
                kink = both_sides(barriers, k, i, error[i] / delta, -1.0, 1.0, 1.0, weight * steepness, mu, advance)
                total += kink.value
                first += kink.gradient / delta
                curved += kink.curvature / (delta * delta)
            by_error[i] = first
            for a in range(n):
                gradient[k, a] += first * error_jacobian[i, a]
                part = curved * error_jacobian[i, a]
                for b in range(a + 1):
                    diagonal[k, a, b] += part * error_jacobian[i, b]
        if exact:
            second_order(kind, knot, second[k])
    return total


@uncounted
def _add_motion(problem, path, barrier, advance, workspace):
    """Adds the velocity costs and the limits of velocity, acceleration and position; gives their value."""
    data, start, cost, dt = problem.data, problem.start, problem.data.cost, problem.data.dt
    lengths, velocities, braking = problem.grid.length, problem.grid.velocity, problem.braking
    joint_weights = problem.joint_weights
    lower, upper, limits, changes = data.limits[LOWER], data.limits[UPPER], data.limits[FASTEST], problem.change_limit
    model, barriers, before = workspace.model, workspace.barriers, workspace.before
    gradient, diagonal, coupling, far = model.gradient, model.diagonal, model.coupling, model.far
    weight, mu = barrier.limit_weight, barrier.mu
    (knots, n), e, total = path.shape, workspace.knot.error.shape[0], 0.0
    rate_before = 0.0
    for k in range(knots):
        rate, span, ends = 1.0 / (lengths[k] * dt), change_steps(lengths, k), braking and k == knots - 1
        for j in range(n):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            change = velocity - (before[j] if k > 0 else problem.qdot_before[j])
            before[j], limit, most = velocity, limits[j], span * changes[j]
            per = dt / changes[j] if ends else 0.0  # 1 / q̈_max
            speed = both_sides(barriers, k, e + j, velocity, -limit, limit, limit, weight, mu, advance)
            turn = both_sides(barriers, k, e + n + j, change, -most, most, most, weight, mu, advance)
            reach = path[k, j] + braking_way(velocity, per)
            place = both_sides(barriers, k, e + 2 * n + j, reach, lower[j], upper[j], dt * limit, weight, mu, advance)
            first, twice = velocity_derivatives(cost, velocity)
            count = velocities[k] * joint_weights[j]
            total += count * velocity_cost(cost, velocity) + speed.value + turn.value + place.value
            # The place reached, q + v |v| / (2 q̈_max), by the chain rule; its curvature where it is convex.
            further = per * abs(velocity)
            convex = max(math.copysign(per, velocity) * place.gradient, 0.0)
            by_velocity = (count * first + speed.gradient + place.gradient * further) * rate
            mixed = place.curvature * further * rate
            curved = count * twice + speed.curvature + place.curvature * further * further + convex
            curved *= rate * rate
            a, c, turned = rate, rate_before, turn.curvature
            gradient[k, j] += by_velocity + place.gradient + turn.gradient * a
            diagonal[k, j, j] += curved + place.curvature + 2.0 * mixed + turned * a * a
            if k > 0:
                gradient[k - 1, j] -= by_velocity + turn.gradient * (a + c)
                diagonal[k - 1, j, j] += curved + turned * (a + c) * (a + c)
                coupling[k, j] += curved + mixed + turned * a * (a + c)
            if k > 1:
                gradient[k - 2, j] += turn.gradient * c
                diagonal[k - 2, j, j] += turned * c * c
                coupling[k - 1, j] += turned * c * (a + c)
                far[k, j] += turned * a * c
        rate_before = rate
    return total


@inlined
def change_steps(lengths, k):
    """The steps that a change of velocity at the beginning of block ``k`` takes.

    Between blocks of a and b steps it takes (a + b) / 2; that from the velocity before is made in the first step.
    """
    return 0.5 * (lengths[k - 1] + lengths[k]) if k > 0 else 1.0


@inlined
def braking_way(velocity, per):
    """Braking distance of a joint, in [rad] or [m], with 1 / q̈_max ``per``; 0 where that is 0."""
    return 0.5 * per * velocity * abs(velocity)


@inlined
def _kink_value(x, weight, mu):
    return _value(x, -1.0, 1.0, 1.0, weight, mu) if weight > 0.0 else 0.0


@inlined
def _value(x, low, high, scale, weight, mu):
    """φ of both bounds of x, in units of a scale."""
    total = 0.0
    if high < math.inf:
        total += smooth((x - high) / scale, weight, mu).value
    if low > -math.inf:
        total += smooth((low - x) / scale, weight, mu).value
    return total


@inlined
def both_sides(barriers, k, i, x, low, high, scale, weight, mu, advance):
    """The ``i``-th quantity of knot ``k`` between its bounds; gives a :class:`Bounded`, and brings its λ up to date."""
    value = gradient = curvature = 0.0
    if high < math.inf:
        here = one_side(barriers, k, i, 0, (x - high) / scale, weight, mu, advance)
        value, gradient, curvature = here.value, here.gradient / scale, here.curvature / (scale * scale)
    if low > -math.inf:
        here = one_side(barriers, k, i, 1, (low - x) / scale, weight, mu, advance)
        value += here.value
        gradient -= here.gradient / scale
        curvature += here.curvature / (scale * scale)
    return Bounded(value, gradient, curvature)
