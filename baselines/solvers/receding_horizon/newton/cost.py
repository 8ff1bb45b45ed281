"""Kernels: the cost of a joint path, its gradient, and the blocks of its Hessian.

The tracking cost of a knot touches its own joint coordinates alone, the velocity cost of a block those of its two ends,
joint by joint: the Hessian is block-tridiagonal, with diagonal blocks beside the diagonal.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.solvers.receding_horizon.newton.multipliers import press
from ikgym import cost_kernels, task_kernels
from ikgym.cost_kernels import P_X_INSIDE, CostParameters
from ikgym.jit import inlined, kernel
from ikgym.kinematics import Chain, forward, forward_and_jacobian

# All loops take their arrays out of the tuples first: numba counts references at each access, which costs more than the
# kinematics do.

# ρ of a kink, in units of its steepness over Δ: the larger, the fewer updates of λ and the harder for Newton.
KINK_STIFFNESS = 100.0
# ρ of a limit of the velocities, in units of the curvature of Φ^U there, and of one of the joints, in units of that of
# Φ^X at rest. Tracking presses with the curvature that errors of many Δx have: with a lower ρ the multipliers do not
# get there in time.
VELOCITY_STIFFNESS = 300.0
JOINT_STIFFNESS = 1e4
# Velocities below this share of Δq̇ count as this share in the curvature of Φ^U, which vanishes at rest.
REST = 1e-3


class Rules(NamedTuple):
    """What is the same at all knots.

    Attributes:
        chain: The model of the arm.
        kind: The kind of task coordinates.
        cost: The cost's parameters.
        dt: Δt in [s].
        lower: Least joint coordinates in [rad] or [m], -inf where there is no limit. Shape (n,).
        upper: Largest joint coordinates. Shape (n,).
        velocity_limit: Largest joint velocities in [rad/s] or [m/s]. Shape (n,).
    """

    chain: Chain
    kind: int
    cost: CostParameters
    dt: float
    lower: npt.NDArray[np.float64]
    upper: npt.NDArray[np.float64]
    velocity_limit: npt.NDArray[np.float64]


class Scratch(NamedTuple):
    """Arrays of one knot that are used again and again, and the factor of the limits' stiffness. Shape (1,)."""

    rotation: npt.NDArray[np.float64]
    position: npt.NDArray[np.float64]
    geometric: npt.NDArray[np.float64]
    pose: npt.NDArray[np.float64]
    error: npt.NDArray[np.float64]
    jacobian: npt.NDArray[np.float64]
    error_jacobian: npt.NDArray[np.float64]
    slope: npt.NDArray[np.float64]
    pull: npt.NDArray[np.float64]
    firmness: npt.NDArray[np.float64]


class Blocks(NamedTuple):
    """The quadratic model of the cost at a path.

    Attributes:
        gradient: Shape (K, n).
        diagonal: Gauss–Newton blocks of the Hessian, lower triangles. Shape (K, n, n).
        second: What is missing to the Hessian's own: Σ slope ∂²error, lower triangles. Shape (K, n, n).
        coupling: The negative of the diagonal block between a knot and the one before. Shape (K, n).
    """

    gradient: npt.NDArray[np.float64]
    diagonal: npt.NDArray[np.float64]
    second: npt.NDArray[np.float64]
    coupling: npt.NDArray[np.float64]


@kernel
def scratch_for(kind, m, n):
    """Scratch for task coordinates of ``m`` numbers and ``n`` joints."""
    e = 6 if kind == task_kernels.POSE else m
    return Scratch(
        np.empty((3, 3)),
        np.empty(3),
        np.empty((6, n)),
        np.empty(m),
        np.empty(e),
        np.empty((e, n)),
        np.empty((e, n)),
        np.empty(e),
        np.empty((3, 3)),
        np.ones(1),
    )


@kernel
def blocks_for(knots, n):
    """Room for the quadratic model of a path."""
    return Blocks(np.empty((knots, n)), np.empty((knots, n, n)), np.empty((knots, n, n)), np.empty((knots, n)))


@kernel
def true_cost(rules, grid, start, nominal, path, scratch):
    """The cost of a path, from the same kernels as the environment's; limits apart.

    Args:
        rules: A :class:`Rules`.
        grid: The :class:`baselines.solvers.receding_horizon.newton.grid.Grid`.
        start: Joint coordinates now. Shape (n,).
        nominal: Nominal task coordinates 1, 2, … steps ahead. Shape (at least grid.at[-1], m).
        path: Joint coordinates at the knots. Shape (K, n).
        scratch: A :class:`Scratch`.
    """
    cost, kind, chain, dt = rules.cost, rules.kind, rules.chain, rules.dt
    rotation, position, pose, error = scratch.rotation, scratch.position, scratch.pose, scratch.error
    at, lengths, tracking, often = grid.at, grid.length, grid.tracking, grid.velocity
    total = 0.0
    for k in range(path.shape[0]):
        if tracking[k] != 0.0:
            forward(chain, path[k], rotation, position)
            task_kernels.coordinates(kind, rotation, position, pose)
            task_kernels.error(kind, nominal[at[k] - 1], pose, error)
            total += tracking[k] * cost_kernels.tracking(cost, error)
        rate = 1.0 / (lengths[k] * dt)
        for j in range(path.shape[1]):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            total += often[k] * cost_kernels.value(velocity, cost.delta_qdot, cost.p_in, cost.p_out)
    return total


@kernel
def merit(rules, grid, start, nominal, path, multipliers, scratch):
    """The smooth function that Newton's method minimises: the cost with its kinks and limits held by multipliers.

    Args:
        rules: A :class:`Rules`.
        grid: The grid.
        start: Joint coordinates now. Shape (n,).
        nominal: Nominal task coordinates ahead. Shape (at least grid.at[-1], m).
        path: Joint coordinates at the knots. Shape (K, n).
        multipliers: λ₀ of each knot: of its e errors, its n velocities and its n joint coordinates.
            Shape (K, e + 2 n).
        scratch: A :class:`Scratch`.
    """
    cost, kind, chain, dt = rules.cost, rules.kind, rules.chain, rules.dt
    rotation, position, pose, error = scratch.rotation, scratch.position, scratch.pose, scratch.error
    at, lengths, tracking, often = grid.at, grid.length, grid.tracking, grid.velocity
    limits, lower, upper = rules.velocity_limit, rules.lower, rules.upper
    firmness = scratch.firmness[0]
    e, n = error.shape[0], path.shape[1]
    total = 0.0
    for k in range(path.shape[0]):
        if tracking[k] != 0.0:
            forward(chain, path[k], rotation, position)
            task_kernels.coordinates(kind, rotation, position, pose)
            task_kernels.error(kind, nominal[at[k] - 1], pose, error)
            part = 0.0
            for i in range(e):
                part += _tracking(cost, error[i], multipliers[k, i])[0]
            total += tracking[k] * part
        rate = 1.0 / (lengths[k] * dt)
        for j in range(n):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            if often[k] != 0.0:
                total += often[k] * cost_kernels.value(velocity, cost.delta_qdot, cost.p_in, cost.p_out)
            if multipliers[k, e + j] != 0.0 or abs(velocity) > limits[j]:
                total += _velocity_limit(rules, j, velocity, multipliers[k, e + j], firmness)[0]
            if multipliers[k, e + n + j] != 0.0 or path[k, j] < lower[j] or path[k, j] > upper[j]:
                total += _joint_limit(rules, j, path[k, j], multipliers[k, e + n + j], firmness)[0]
    return total


@kernel
def linearise(rules, grid, start, nominal, path, multipliers, advance, exact, scratch, blocks):
    """:func:`merit`, its gradient and its Hessian.

    Args:
        rules: A :class:`Rules`.
        grid: The grid.
        start: Joint coordinates now. Shape (n,).
        nominal: Nominal task coordinates ahead. Shape (at least grid.at[-1], m).
        path: Joint coordinates at the knots. Shape (K, n).
        multipliers: λ₀, see :func:`merit`. Shape (K, e + 2 n).
        advance: Whether to replace λ₀ by the λ of the path first.
        exact: Whether the second derivatives of the error are wanted, too.
        scratch: A :class:`Scratch`.
        blocks: Receives gradient and Hessian.

    Returns:
        The merit; the true cost; and by how much the true cost exceeds what its multipliers say, with each limit's
        share: 0 where the multipliers are those of a minimum.
    """
    cost, kind, chain, dt = rules.cost, rules.kind, rules.chain, rules.dt
    rotation, position, geometric, pose = scratch.rotation, scratch.position, scratch.geometric, scratch.pose
    error, slopes = scratch.error, scratch.slope
    at, lengths, tracking, often = grid.at, grid.length, grid.tracking, grid.velocity
    gradient, diagonal, second, coupling = blocks.gradient, blocks.diagonal, blocks.second, blocks.coupling
    jacobian, error_jacobian = scratch.jacobian, scratch.error_jacobian
    limits, lower, upper = rules.velocity_limit, rules.lower, rules.upper
    firmness = scratch.firmness[0]
    e, n = error.shape[0], path.shape[1]
    total = true = gap = 0.0
    for k in range(path.shape[0]):
        weight = tracking[k]
        for a in range(n):
            gradient[k, a] = 0.0
            for b in range(a + 1):
                diagonal[k, a, b] = 0.0
        if weight != 0.0:
            forward_and_jacobian(chain, path[k], rotation, position, geometric)
            task_kernels.coordinates(kind, rotation, position, pose)
            task_kernels.error(kind, nominal[at[k] - 1], pose, error)
            task_kernels.jacobian(kind, rotation, geometric, jacobian)
            task_kernels.error_jacobian(kind, error, jacobian, error_jacobian)
            for i in range(e):
                if advance:
                    multipliers[k, i] = _tracking(cost, error[i], multipliers[k, i])[3]
                value, slope, bend, _, excess = _tracking(cost, error[i], multipliers[k, i])
                total += weight * value
                true += weight * cost_kernels.value(error[i], cost.delta_x, P_X_INSIDE, cost.p_x)
                gap += weight * excess
                slope *= weight
                bend *= weight
                slopes[i] = slope
                for a in range(n):
                    gradient[k, a] += slope * error_jacobian[i, a]
                    pull = bend * error_jacobian[i, a]
                    for b in range(a + 1):
                        diagonal[k, a, b] += pull * error_jacobian[i, b]
        if exact:
            if weight != 0.0:
                _second_order(kind, scratch, second[k])
            else:
                second[k] = 0.0
        rate = 1.0 / (lengths[k] * dt)
        for j in range(n):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            slope = bend = 0.0
            if often[k] != 0.0:
                value = often[k] * cost_kernels.value(velocity, cost.delta_qdot, cost.p_in, cost.p_out)
                total += value
                true += value
                slope = often[k] * cost_kernels.gradient(velocity, cost.delta_qdot, cost.p_in, cost.p_out)
                felt = max(abs(velocity), REST * cost.delta_qdot)
                bend = often[k] * cost_kernels.curvature(felt, cost.delta_qdot, cost.p_in, cost.p_out)
            if multipliers[k, e + j] != 0.0 or abs(velocity) > limits[j]:
                if advance:
                    multipliers[k, e + j] = _velocity_limit(rules, j, velocity, multipliers[k, e + j], firmness)[1]
                value, pressure, stiffness, share = _velocity_limit(rules, j, velocity, multipliers[k, e + j], firmness)
                total += value
                gap += abs(share)
                slope += pressure
                bend += stiffness
            slope *= rate
            bend *= rate * rate
            coupling[k, j] = bend
            gradient[k, j] += slope
            diagonal[k, j, j] += bend
            if k > 0:
                gradient[k - 1, j] -= slope
                diagonal[k - 1, j, j] += bend
            if multipliers[k, e + n + j] != 0.0 or path[k, j] < lower[j] or path[k, j] > upper[j]:
                if advance:
                    multipliers[k, e + n + j] = _joint_limit(rules, j, path[k, j], multipliers[k, e + n + j], firmness)[
                        1
                    ]
                value, pressure, stiffness, share = _joint_limit(
                    rules, j, path[k, j], multipliers[k, e + n + j], firmness
                )
                total += value
                gap += abs(share)
                gradient[k, j] += pressure
                diagonal[k, j, j] += stiffness
    return total, true, gap


@inlined
def _tracking(cost, error, multiplier):
    """One component of Φ^X with its kink held: value, slope, curvature, λ, and the true value less λ's."""
    value = cost_kernels.value(error, cost.delta_x, P_X_INSIDE, cost.p_x)
    slope = cost_kernels.gradient(error, cost.delta_x, P_X_INSIDE, cost.p_x)
    bend = cost_kernels.curvature(error, cost.delta_x, P_X_INSIDE, cost.p_x)
    steepness = cost.p_x - P_X_INSIDE
    if steepness <= 0.0:
        return value, slope, bend, 0.0, 0.0
    x = error / cost.delta_x
    beyond = abs(x) - 1.0
    if beyond > 0.0:
        # The part beyond the kink is taken out, and comes back smooth.
        value -= steepness * beyond
        slope -= math.copysign(steepness / cost.delta_x, x)
    part, pressure, stiffness, share = press(x, -1.0, 1.0, multiplier, KINK_STIFFNESS, 1.0)
    return (
        value + steepness * part,
        slope + steepness * pressure / cost.delta_x,
        bend + steepness * stiffness / (cost.delta_x * cost.delta_x),
        pressure,
        steepness * (max(beyond, 0.0) - share),
    )


@inlined
def _velocity_limit(rules, j, velocity, multiplier, firmness):
    limit, cost = rules.velocity_limit[j], rules.cost
    stiffness = (
        firmness * VELOCITY_STIFFNESS * cost_kernels.curvature(limit, cost.delta_qdot, cost.p_in, max(cost.p_out, 2.0))
    )
    return press(velocity, -limit, limit, multiplier, stiffness, math.inf)


@inlined
def _joint_limit(rules, j, q, multiplier, firmness):
    stiffness = firmness * JOINT_STIFFNESS * 2.0 / (rules.cost.delta_x * rules.cost.delta_x)
    return press(q, rules.lower[j], rules.upper[j], multiplier, stiffness, math.inf)


@kernel
def _second_order(kind, scratch, out):
    """Σ slope_i ∂²error_i / ∂q², the lower triangle; for POSE as if the rotation error were small.

    With the geometric columns (v_j, w_j) and joint b not behind joint a: ∂v_a / ∂q_b = w_b × v_a, and for the rotation
    R the second derivative is w_b × (w_a × R).
    """
    n, e = out.shape[0], scratch.slope.shape[0]
    g, rotation, slope, pull = scratch.geometric, scratch.rotation, scratch.slope, scratch.pull
    # The error falls as the coordinates rise: forces are minus the slopes.
    where = 0 if kind == task_kernels.POSE else e - 3
    fx, fy, fz = -slope[where], -slope[where + 1], -slope[where + 2]
    tx = ty = tz = 0.0
    if kind == task_kernels.POSE:
        tx, ty, tz = -0.5 * slope[3], -0.5 * slope[4], -0.5 * slope[5]
    turns = kind in (task_kernels.SKEW, task_kernels.MATRIX)
    trace = 0.0
    if turns:
        # With G = ∂Φ / ∂R: Σ G : w_b × (w_a × R) = w_aᵀ (G Rᵀ - tr(G Rᵀ)) w_b.
        for i in range(3):
            for j in range(3):
                total = 0.0
                for c in range(3):
                    total += _force(kind, slope, i, c) * rotation[j, c]
                pull[i, j] = total
            trace += pull[i, i]
        for i in range(3):
            pull[i, i] -= trace
    for a in range(n):
        vx, vy, vz = g[0, a], g[1, a], g[2, a]
        wx, wy, wz = g[3, a], g[4, a], g[5, a]
        # f · (w_b × v_a) = w_b · (v_a × f)
        ux, uy, uz = vy * fz - vz * fy, vz * fx - vx * fz, vx * fy - vy * fx
        if turns:
            ux += wx * pull[0, 0] + wy * pull[1, 0] + wz * pull[2, 0]
            uy += wx * pull[0, 1] + wy * pull[1, 1] + wz * pull[2, 1]
            uz += wx * pull[0, 2] + wy * pull[1, 2] + wz * pull[2, 2]
        elif kind == task_kernels.POSE:
            # ω = Σ w_j q_j' has ∂w_a / ∂q_b = w_b × w_a, of which half is left in the rotation vector.
            ux += wy * tz - wz * ty
            uy += wz * tx - wx * tz
            uz += wx * ty - wy * tx
        for b in range(a + 1):
            out[a, b] = g[3, b] * ux + g[4, b] * uy + g[5, b] * uz


@inlined
def _force(kind, slope, i, j):
    """∂Φ / ∂R_ij."""
    if kind == task_kernels.MATRIX:
        return -slope[3 * i + j]
    if i == j:
        return 0.0
    # O^A_12, O^A_13, O^A_23 stand at 0, 1, 2.
    return -0.5 * slope[i + j - 1] if i < j else 0.5 * slope[i + j - 1]
