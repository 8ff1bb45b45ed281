"""Kernels: Levenberg–Marquardt steps towards a pose, from one posture."""

from __future__ import annotations

import math

from ikgym.kernels.jit import inlined, uncounted
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.kernels.linear_algebra import cholesky, cholesky_solve
from ikgym.kernels.rotations import quaternion_of, vector_factor

# λ / |e|², the steps that a start is worth, and when it is given up: where PATIENCE steps in a row have not made |e|²
# smaller by the factor PROGRESS. From 0.05 to 0.2 and from 3 to 9 times differ by less than a fifth, on random poses of
# the arms of the catalogue.
DAMPING = 0.1
STEPS = 40
PATIENCE, PROGRESS = 6, 0.5
# The smallest λ / length²: the equations can be solved where J has fewer columns than rows, or has lost rank.
SMALLEST_DAMPING = 1e-13


@uncounted
def descend(chain, ranges, pose, settings, work):
    """Steps from ``work.q`` until the pose is met or nothing is gained any more; leaves the error where it ends."""
    milestone, waited = math.inf, 0
    for left in range(STEPS, -1, -1):
        forward_and_jacobian(chain, work.q, work.rotation, work.position, work.jacobian)
        pose_error(pose, settings.length, work)
        if is_reached(work.error, settings):
            return
        error = square_length(work.error)
        waited += 1
        if error < PROGRESS * milestone:
            milestone, waited = error, 0
        if waited == PATIENCE or left == 0:
            return
        for i in range(3, work.error.shape[0]):
            for j in range(work.q.shape[0]):
                work.jacobian[i, j] *= settings.length
        _step(ranges, DAMPING * error + SMALLEST_DAMPING * settings.length * settings.length, work)


@uncounted
def _step(ranges, damping, work):
    """A step of ``work.q`` within the limits."""
    for _ in range(work.q.shape[0]):
        _gram(damping, work)
        if not cholesky(work.gram):
            return
        copy(work.error, work.weights)
        cholesky_solve(work.gram, work.weights)
        if not _hold(ranges, work):
            break
    for j in range(work.q.shape[0]):
        work.q[j] += work.step[j]


@inlined
def _gram(damping, work):
    """J Jᵀ + λ, its lower triangle."""
    jacobian, gram = work.jacobian, work.gram
    for i in range(gram.shape[0]):
        for k in range(i + 1):
            total = damping if i == k else 0.0
            for j in range(jacobian.shape[1]):
                total += jacobian[i, j] * jacobian[k, j]
            gram[i, k] = total


@inlined
def _hold(ranges, work):
    """Takes the joints that would pass a limit to it, and their part off the error; returns whether there are any."""
    q, step, jacobian = work.q, work.step, work.jacobian
    m = work.error.shape[0]
    passed = False
    for j in range(q.shape[0]):
        step[j] = 0.0
        for i in range(m):
            step[j] += jacobian[i, j] * work.weights[i]
        there = min(max(q[j] + step[j], ranges.lower[j]), ranges.upper[j])
        if there != q[j] + step[j]:
            for i in range(m):
                work.error[i] -= jacobian[i, j] * (there - q[j])
                jacobian[i, j] = 0.0
            q[j], step[j] = there, 0.0
            passed = True
    return passed


@inlined
def pose_error(pose, length, work):
    """The error of ``work.rotation`` and ``work.position``."""
    rotation, position = pose
    error = work.error
    for i in range(3):
        error[i] = position[i] - work.position[i]
    if error.shape[0] == 3:
        return
    w, x, y, z = quaternion_of(
        _row(rotation[0], work.rotation), _row(rotation[1], work.rotation), _row(rotation[2], work.rotation)
    )
    factor = length * vector_factor(w, x, y, z)
    error[3], error[4], error[5] = factor * x, factor * y, factor * z


@inlined
def _row(row, rotation):
    """A row of a matrix times the transpose of a rotation."""
    return (
        row[0] * rotation[0, 0] + row[1] * rotation[0, 1] + row[2] * rotation[0, 2],
        row[0] * rotation[1, 0] + row[1] * rotation[1, 1] + row[2] * rotation[1, 2],
        row[0] * rotation[2, 0] + row[1] * rotation[2, 1] + row[2] * rotation[2, 2],
    )


@inlined
def is_reached(error, settings):
    """Whether position and orientation both are within the tolerance."""
    most = settings.tolerance * settings.tolerance
    if not error[0] * error[0] + error[1] * error[1] + error[2] * error[2] <= most:
        return False
    if error.shape[0] == 3:
        return True
    angle = error[3] * error[3] + error[4] * error[4] + error[5] * error[5]
    return angle <= most * settings.length * settings.length


@inlined
def copy(vector, out):
    """Copies a vector."""
    for i in range(out.shape[0]):
        out[i] = vector[i]


@inlined
def square_length(vector):
    """The squared length of a vector."""
    total = 0.0
    for i in range(vector.shape[0]):
        total += vector[i] * vector[i]
    return total
