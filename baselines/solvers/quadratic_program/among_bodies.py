"""The quadratic program among bodies: a body that comes near one is slowed down in time to stop before contact."""

from __future__ import annotations

import numpy as np

from baselines.policy_kernels import BRAKING
from baselines.solvers.near_bodies import ROWS, bodies_of, near_distances, near_work
from baselines.solvers.quadratic_program.program import held_back, row_program
from baselines.solvers.quadratic_program.row_minimum import row_minimum
from baselines.solvers.quadratic_program.velocity_box import braking_speed
from baselines.solvers.resolved_rate.base import APPLIED, task_motion
from baselines.status import Status
from ikgym.kernels.jit import inlined, inner, kernel, uncounted
from ikgym.kernels.limits import FASTEST, LOWER, UPPER
from ikgym.kernels.linear_algebra import cholesky, dot, inverse_of_factor

LIMIT, SATURATED = int(Status.ITERATION_LIMIT), int(Status.SATURATED)
# Share of the way to the clearance that a step may take, the distance for joint motions in the null space, in
# [1/s], and from which share of a gradient on they are the way out.
APPROACH, GENTLE, ASIDE = 0.25, 10.0, 0.02
# Share of a missing clearance that a step takes back, and share of the acceleration limits that braking
# assumes: the joints also have a task.
RETREAT, BRAKES = 0.1, 0.5
# A joint motion that changes a distance by less than this for a unit of it is no way to change it, in [m]; shares of
# the largest joint velocities and, in [1/s], of the way to a stop that lead away from near bodies.
LEVER, AWAY, TO_STOP = 0.05, 0.5, 3.0
# A row that is met so closely holds the arm back, in [m/s].
MET = 1e-9


@inlined
def largest_approach(distance, clearance, dt, change, share):
    """The largest speed at which a pair may come nearer, in [m/s]; below 0 where it is nearer than it should be.

    A velocity damper (Faverjon and Tournassoud 1987): the speed is a share of the way that is left. It is also one
    from which the pair comes to rest within that way, with so large a change of the speed in one step, in [m/s]; see
    :func:`braking_speed`. ``share`` is that in one step of Δt in [s]; distance and clearance are in [m].
    """
    room = (distance - clearance) / dt
    return min(share * room, braking_speed(room, change)) if room >= 0.0 else RETREAT * room


@inlined
def _aside(projection, gradient, motion):
    """A gradient in the joint motions that leave the task alone, P ∇d, (n,), and ∇dᵀ P ∇d: see :func:`keep_clear`."""
    for j in range(motion.shape[0]):
        motion[j] = 0.0
    for k in range(motion.shape[0]):
        if gradient[k] != 0.0:  # many joints do not change a distance
            for j in range(motion.shape[0]):
                motion[j] += projection[k, j] * gradient[k]
    return dot(motion, gradient)


@inner
def task_free(hessian, weight, projection):
    """P = w H⁻¹, of the joint motions that leave the task alone; 0 where H is not positive definite. Shape (n, n).

    H = (J Δt)ᵀ J Δt + w I is in the upper left corner of that of the program.
    """
    n = projection.shape[0]
    factor = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            factor[i, j], projection[i, j] = hessian[i, j], 0.0
    if cholesky(factor):
        inverse_of_factor(factor, projection)
    for i in range(n):
        for j in range(n):
            projection[i, j] *= weight


@uncounted
def keep_clear(model, numbers, q, projection, count, near, motion, velocity):
    """Rows that keep pairs from touching, and joint velocities that lead away from them aside from the task.

    ∇dᵀ q̇ is at least minus :func:`largest_approach`. Motions in the null space begin early and
    gently, since they have little acceleration for it. Motions of the task itself, such as one of the tool to a table,
    is slowed down as late as braking allows.

    Each pair also asks for the joint motion aside from the task that would take it out of the distance of influence d*,
    (d* - d) P ∇d / (∇dᵀ P ∇d), weighted by (1 - d / d*)². All of them together make at most a share of the largest
    joint velocities, and less near a stop.

    Args:
        model: The :class:`Model`.
        numbers: The fields of :class:`QuadraticProgram`.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        projection: P, see :func:`task_free`. Shape (n, n).
        count: How many rows there are.
        near: Distances and distances of influence of :func:`near_distances`; receives the least rates in [m/s], -inf
            where no joint changes the distance. Shapes (ROWS,). Then its gradients.
        motion: Worked with. Shape (n,).
        velocity: Receives the joint velocities. Shape (n,).

    Returns:
        How much is left of other preferences: the smallest d / d*, at most 1.
    """
    distances, reaches, bounds, gradients = near
    n, dt, braking, nearest = velocity.shape[0], model.dt, model.limits[BRAKING], 1.0
    for j in range(n):
        velocity[j] = 0.0
    for i in range(count):
        away, change, square = gradients[i], 0.0, 0.0
        for j in range(n):
            if away[j] != 0.0:
                change += BRAKES * abs(away[j]) * braking[j]
                square += away[j] * away[j]
        bounds[i] = -np.inf
        lever = _aside(projection, away, motion)
        if lever == 0.0:
            continue
        part = lever / (ASIDE * square)
        share = (1.0 + part) / (1.0 / APPROACH + part / min(GENTLE * dt, APPROACH))
        bounds[i] = -largest_approach(distances[i], numbers.clearance, dt, change, share)
        missing = reaches[i] - distances[i]
        amount = numbers.repulsion * min(missing / reaches[i], 1.0) ** 2 * missing / (lever + LEVER * LEVER)
        for j in range(n):
            velocity[j] += amount * motion[j]
        nearest = min(nearest, distances[i] / reaches[i])
    _moderate(model.limits, q, velocity)
    return min(max(nearest, 0.0), 1.0)


@uncounted
def _moderate(limits, q, velocity):
    """Shortens joint velocities to a share of the largest ones, and of the way to a stop: shapes (5, n), (n,), (n,)."""
    share = 1.0
    for j in range(q.shape[0]):
        room = limits[UPPER, j] - q[j] if velocity[j] > 0.0 else q[j] - limits[LOWER, j]
        most = min(AWAY * limits[FASTEST, j], TO_STOP * max(room, 0.0))
        if abs(velocity[j]) > most:
            share = min(share, most / abs(velocity[j]))
    for j in range(q.shape[0]):
        velocity[j] *= share


@kernel
def qp_step_among(model, numbers, batch, solution):
    """One step of :class:`QuadraticProgram` among bodies; see :class:`CompiledPolicy` for the arguments."""
    task, (shapes, checked) = task_motion(model, batch, solution.memory), bodies_of(numbers.bodies)
    n, size = batch.q.shape[1], batch.q.shape[1] + numbers.task_scaling
    program = np.empty((size, size)), np.empty(size), np.zeros(size), np.zeros(size)
    near = np.empty(ROWS), np.empty(ROWS), np.empty(ROWS), np.zeros((ROWS, size))
    work = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n), np.empty(size)
    bodies = shapes, checked, near_work(n, shapes.links.shape[0])
    for row in range(batch.q.shape[0]):
        _row(row, model, numbers, batch, task, bodies, program, near, work, solution)


@uncounted
def _row(row, model, numbers, batch, task, bodies, program, near, work, solution):
    """The step of one arm."""
    (hessian, linear, lower, upper), (distances, reaches, bounds, rows), q = program, near, batch.q[row]
    (shapes, checked, places), (projection, motion, preferred, away, x) = bodies, work
    jac, shift, error, qdot, pull = task[0][row], task[1][row], task[2][row], solution.qdot[row], numbers.pull
    args = shapes, checked, numbers.boxes[row % numbers.boxes.shape[0]], q, numbers.influence
    count = near_distances(model.chain, *args, places, distances, reaches, rows)
    for j in range(q.shape[0]):
        preferred[j] = pull[0, j] * (pull[1, j] - q[j])
    weight = row_program(model, numbers, q, batch.qdot[row], batch.change[row], jac, shift, error, preferred, program)
    task_free(hessian, weight, projection)
    left = keep_clear(model, numbers, q, projection, count, near, motion, away)
    for j in range(q.shape[0]):
        away[j] -= (1.0 - left) * preferred[j]
        preferred[j] += away[j]
        linear[j] += weight * numbers.weights[j] * away[j]
    solution.iterations[row], found = row_minimum(hessian, linear, lower, upper, rows, bounds, count, x)
    for j in range(q.shape[0]):
        qdot[j] = x[j]
    solution.status[row] = APPLIED if found else LIMIT
    met = False
    for i in range(count):
        met = met or dot(rows[i], x) <= bounds[i] + MET
    if found and held_back(jac, shift, weight, numbers.weights, preferred, qdot, lower, upper, met):
        solution.status[row] = SATURATED
