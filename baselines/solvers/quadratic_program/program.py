"""Kernels: the quadratic program of one arm and one step, ½ q̇ᵀ H q̇ - gᵀ q̇."""

from __future__ import annotations

import math

import numpy as np

from baselines.solvers.quadratic_program.velocity_box import braking_speed, calm_gain, smooth_box
from ikgym.kernels.jit import inner, uncounted
from ikgym.kernels.limits import CHANGE, FASTEST
from ikgym.kernels.linear_algebra import cholesky, cholesky_solve, transposed_product
from ikgym.kernels.tasks import AXIS, POSE

# Weight of the length of a task shift against its direction, and of joint motion against that.
SCALING_WEIGHT = 1e-2
# The error of a path that an arm accepts rather than rest, and the motion in one step below which the path
# itself rests, in [m] or [rad].
TAKEN_ON, STILL = 1e-5, 1e-9


@uncounted
def weigh_rotation(kind, weight, jacobian, motion, error):
    """Multiplies the rows of rotation by their weight in [m/rad]: shapes (e, n), (e,), (e,)."""
    e = error.shape[0]
    first, last = (3, e) if kind in (POSE, AXIS) else (0, e - 3)  # where there is no orientation: none
    for a in range(first, last):
        motion[a] *= weight
        error[a] *= weight
        for j in range(jacobian.shape[1]):
            jacobian[a, j] *= weight


@uncounted
def motion_weight(jacobian, error, damping, lm_damping, weights, fastest):
    """Weight of the joint motion against the task shift, see :class:`QuadraticProgram`.

    J Δt has shape (e, n), the present error (e,), weights of the joints and their largest velocities in [rad/s] or
    [m/s] (n,).
    """
    e, n = jacobian.shape
    columns, square, most = 0.0, 0.0, 0.0
    for a in range(e):
        square += error[a] * error[a]
        for j in range(n):
            columns += jacobian[a, j] * jacobian[a, j] / weights[j]
    for j in range(n):
        most = max(most, fastest[j])
    return damping * columns / n + lm_damping * square / (most * most)


@uncounted
def curvature(jacobian, weight, weights, hessian):
    """H = (J Δt)ᵀ J Δt + weight · W, in the upper left corner: shapes (e, n), a number, (n,), (n, n) or more."""
    e, n = jacobian.shape
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for a in range(e):
                total += jacobian[a, i] * jacobian[a, j]
            hessian[i, j] = hessian[j, i] = total
        hessian[i, i] += weight * weights[i]


@inner
def factorise(hessian, factor):
    """The Cholesky factor of the upper left corner of H, of shape (n, n); whether it is positive definite."""
    n = factor.shape[0]
    for i in range(n):
        for j in range(i + 1):
            factor[i, j] = hessian[i, j]
    return cholesky(factor)


@inner
def feedback_share(factor, jacobian, error, part, changes):
    """The fraction of an error that can be corrected at once, if the joints are to brake in time when it is gone.

    If a joint is too fast for that, all are slowed down by one factor, which keeps the direction. A ``part`` of the
    largest ``changes`` of the velocity in one step, (n,), is assumed; the factor of H has shape (n, n), J Δt
    (e, n).
    """
    n = jacobian.shape[1]
    qdot, share = np.empty(n), 1.0
    transposed_product(jacobian, error, qdot)
    cholesky_solve(factor, qdot)
    for j in range(n):
        speed, change = abs(qdot[j]), part * changes[j]
        if speed > change:
            share = min(share, braking_speed(speed, change) / speed)
    return share


@inner
def limit_secondary(factor, jacobian, motion, error, share, largest, weight, weights, preferred):
    """Limits preferred joint velocities to those that leave the task alone, and to a share of the primary motion.

    So the secondary motion begins and ends with that of the reference, and its accelerations are a share of those that
    the reference needs. An arm that has lost its reference moves to its posture freely.

    Args:
        factor: The Cholesky factor of H. Shape (n, n).
        jacobian: J Δt. Shape (e, n).
        motion: Motion of the reference in one step. Shape (e,).
        error: The present error. Shape (e,).
        share: Largest secondary motion, as a share of the primary one.
        largest: Largest secondary velocities of the joints in [rad/s] or [m/s]. Shape (n,).
        weight: See :func:`motion_weight`.
        weights: Those of the joints. Shape (n,).
        preferred: Preferred joint velocities, changed in place. Shape (n,).
    """
    n = jacobian.shape[1]
    primary, secondary, most, size = np.empty(n), np.empty(n), 0.0, 0.0
    transposed_product(jacobian, motion + error, primary)
    cholesky_solve(factor, primary)
    for j in range(n):
        secondary[j] = weight * weights[j] * preferred[j]
    cholesky_solve(factor, secondary)
    for j in range(n):
        most += weights[j] * primary[j] ** 2
        size += weights[j] * secondary[j] ** 2
    shorter = share * math.sqrt(most / size) if size > share * share * most else 1.0
    for j in range(n):
        if shorter * abs(secondary[j]) > largest[j]:
            shorter = largest[j] / abs(secondary[j])
    for j in range(n):
        preferred[j] = shorter * secondary[j]


@uncounted
def goal(jacobian, shift, weight, weights, preferred, linear):
    """The vector g = (J Δt)ᵀ Δx + weight · W z: shapes (e, n), (e,), a number, (n,), (n,), (n,)."""
    e, n = jacobian.shape
    for j in range(n):
        linear[j] = weight * weights[j] * preferred[j]
        for a in range(e):
            linear[j] += jacobian[a, j] * shift[a]


@uncounted
def goal_to_scale(jacobian, shift, weight, weights, preferred, aim, hessian, linear):
    """The same where the task shift is s Δx: s ‖Δx‖, between 0 and ‖Δx‖, is one more variable, the last.

    Args:
        jacobian: J Δt. Shape (e, n).
        shift: Δx. Shape (e,).
        weight: See :func:`motion_weight`.
        weights: Those of the joints. Shape (n,).
        preferred: Preferred joint velocities. Shape (n,).
        aim: The s that is aimed at; the error that the arm accepts rather than rest; and the largest ‖Δx‖ that
            counts as standing still.
        hessian: H of the joints, which receives the last row and column. Shape (n + 1, n + 1).
        linear: Receives g. Shape (n + 1,).

    Returns:
        ‖Δx‖, 0 at rest.
    """
    (e, n), (share, taken_on, still), length = jacobian.shape, aim, 0.0
    for a in range(e):
        length += shift[a] * shift[a]
    length = math.sqrt(length)
    moves = length > still
    for j in range(n):
        linear[j] = weight * weights[j] * preferred[j]
        along = 0.0
        for a in range(e):
            along += jacobian[a, j] * shift[a]
        hessian[n, j] = hessian[j, n] = -along / length if moves else 0.0
    weight_of_share = max(SCALING_WEIGHT, taken_on / length if moves else 0.0)
    hessian[n, n] = 1.0 + weight_of_share
    linear[n] = weight_of_share * share * length
    return length if moves else 0.0


@uncounted
def goal_along_path(jacobian, motion, error, weight, weights, preferred, speed, hessian, linear):
    """The same where the task shift is s Δx + e, with the motion Δx along a path and a speed s that is aimed at.

    ``error`` is e, of shape (e,), and ``speed`` from 0 to 1; for the others see :func:`goal_to_scale`.
    """
    length = goal_to_scale(jacobian, motion, weight, weights, preferred, (speed, TAKEN_ON, STILL), hessian, linear)
    e, n = jacobian.shape
    for a in range(e):
        for j in range(n):
            linear[j] += jacobian[a, j] * error[a]
        linear[n] -= motion[a] * error[a] / length if length > 0.0 else 0.0
    return length


@uncounted
def held_back(jacobian, shift, weight, weights, preferred, qdot, lower, upper, bound):
    """Whether a bound is met, of a joint or as ``bound`` says, and the task error left weighs more than the motion."""
    (e, n), left, motion = jacobian.shape, 0.0, 0.0
    for j in range(n):
        bound |= qdot[j] == lower[j] or qdot[j] == upper[j]
        motion += weight * weights[j] * (qdot[j] - preferred[j]) ** 2
    for a in range(e):
        missing = shift[a]
        for j in range(n):
            missing -= jacobian[a, j] * qdot[j]
        left += missing * missing
    return bound and left > motion


@inner
def row_program(model, numbers, q, last, change, jacobian, motion, error, preferred, program):
    """The program of one arm: its bounds, H and g; the task shift takes the place of the motion of the reference.

    Args:
        model: The :class:`Model`.
        numbers: The fields of :class:`QuadraticProgram`.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        last: The joint velocities of the step before in [rad/s] or [m/s]. Shape (n,).
        change: By how much they differed from those before. Shape (n,).
        jacobian: J, which becomes J Δt with the weight of the rotation. Shape (e, n).
        motion: Motion of the reference, which becomes the task shift Δx. Shape (e,).
        error: The present error, which becomes the part of it that is corrected. Shape (e,).
        preferred: Preferred joint velocities. Shape (n,).
        program: Receives H, g, lower and upper bounds.

    Returns:
        Weight of the joint motion.
    """
    hessian, linear, lower, upper = program
    smooth_box(model.limits, model.dt, q, last, change, lower, upper)
    if numbers.rotation_weight != 1.0:
        weigh_rotation(model.kind, numbers.rotation_weight, jacobian, motion, error)
    gain = calm_gain(model.limits, numbers.gain)
    for a in range(error.shape[0]):
        error[a] *= gain
        for j in range(q.shape[0]):
            jacobian[a, j] *= model.dt
    weights, n, share = numbers.weights, q.shape[0], 1.0
    weight = motion_weight(jacobian, error, numbers.damping, numbers.lm_damping, weights, model.limits[FASTEST])
    weight *= SCALING_WEIGHT if numbers.task_scaling else 1.0
    curvature(jacobian, weight, weights, hessian)
    factor = np.empty((n, n))
    definite = factorise(hessian, factor)
    if definite and numbers.braking > 0.0:
        share = feedback_share(
            factor, jacobian, error, calm_gain(model.limits, 1.0) * numbers.braking, model.limits[CHANGE]
        )
    if definite and numbers.secondary_share < math.inf:
        share_of_motion, largest = numbers.secondary_share, numbers.secondary_limit
        limit_secondary(factor, jacobian, motion, error, share_of_motion, largest, weight, weights, preferred)
    for a in range(error.shape[0]):
        error[a] *= share
        motion[a] += error[a]
    if numbers.task_scaling:
        aim = 1.0, 0.0, 0.0
        upper[n] = goal_to_scale(jacobian, motion, weight, weights, preferred, aim, hessian, linear)
    else:
        goal(jacobian, motion, weight, weights, preferred, linear)
    return weight
