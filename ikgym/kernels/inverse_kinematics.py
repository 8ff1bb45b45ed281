"""Kernels: joint coordinates for a pose, by Levenberg–Marquardt steps within the limits, from one start after another.

The error is e = (position, length · rotation vector) in the base frame, J its Jacobian. A step minimises
|e - J Δq|² + λ |Δq|² with λ in proportion to |e|² (Chan and Lawrence 1988; Sugihara 2011): cautious far from the pose,
a Gauss–Newton step with its quadratic convergence close to it. A joint that a step would take past a limit goes there
and no further, and the other joints make up for the rest.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.jit import inlined, kernel, uncounted
from ikgym.kernels.kinematics import Chain, forward, forward_and_jacobian
from ikgym.kernels.linear_algebra import cholesky, cholesky_solve, damped_gram
from ikgym.kernels.random_numbers import uniform
from ikgym.kernels.rotations import quaternion_of, vector_factor

# λ / |e|², the steps that a start is worth, and when it is given up: where PATIENCE steps in a row have not made |e|²
# smaller by the factor PROGRESS. From 0.05 to 0.2 and from 3 to 9 times differ by less than a fifth, on random poses of
# the arms of the catalogue.
DAMPING = 0.1
STEPS = 40
PATIENCE, PROGRESS = 6, 0.5
# The smallest λ / length²: the equations can be solved where J has fewer columns than rows, or has lost rank.
SMALLEST_DAMPING = 1e-13


class Ranges(NamedTuple):
    """Ranges of joint coordinates and of restarts, in [rad] or [m].

    Attributes:
        lower: Lower limits, -inf where there is none. Shape (n,).
        upper: Upper limits, inf where there is none. Shape (n,).
        first: Lower ends of the restarts, finite. Shape (n,).
        last: Upper ends of the restarts, finite. Shape (n,).
    """

    lower: npt.NDArray[np.float64]
    upper: npt.NDArray[np.float64]
    first: npt.NDArray[np.float64]
    last: npt.NDArray[np.float64]


class Settings(NamedTuple):
    """Settings of a solve.

    Attributes:
        tolerance: Largest distance from the pose in [m], and largest angle in [rad].
        length: Weight of an angle of 1 rad, in [m].
        restarts: Random starts after the first one.
        key: Key of the random starts.
    """

    tolerance: float
    length: float
    restarts: int
    key: np.uint64


class Work(NamedTuple):
    """Workspace of a solve: a posture, its pose, and a step from it; m is 3 without orientation, and 6 with it.

    Attributes:
        q: Shape (n,).
        step: Shape (n,).
        rotation: Shape (3, 3).
        position: Shape (3,).
        jacobian: Its angular rows in units of length; 0 in columns of joints that a step takes to a limit. (6, n).
        error: Shape (m,).
        gram: Shape (m, m).
        weights: The step is Jᵀ times these. Shape (m,).
    """

    q: npt.NDArray[np.float64]
    step: npt.NDArray[np.float64]
    rotation: npt.NDArray[np.float64]
    position: npt.NDArray[np.float64]
    jacobian: npt.NDArray[np.float64]
    error: npt.NDArray[np.float64]
    gram: npt.NDArray[np.float64]
    weights: npt.NDArray[np.float64]


@kernel
def inverse_rows(
    # The members of a Chain, of Ranges and of Settings one by one: a call from Python takes 0.05 ms less for it, which
    # is as much as three poses.
    offsets,
    axes,
    prismatic,
    tool,
    tool_rotation,
    lower,
    upper,
    first,
    last,
    tolerance,
    length,
    restarts,
    key,
    rotation,
    position,
    start,
    q,
    converged,
):
    """Joint coordinates for N poses, each worked out by itself.

    The first arguments are a :class:`ikgym.kernels.kinematics.Chain`, :class:`Ranges` and :class:`Settings`. The arrays
    of the chain, except ``prismatic``, have a leading axis for arms: N of them, or one for all poses.
    ``rotation`` (N, 3, 3), of shape (N, 0, 0) where orientations do not matter, and ``position`` (N, 3) in [m] are the
    poses of the tool in the base frame, ``start`` (N, n) is where to begin, within the limits. ``q`` (N, n) receives
    the joint coordinates, the nearest that were found where the pose is not met, and ``converged`` (N,) whether it is.
    """
    ranges = Ranges(lower, upper, first, last)
    settings = Settings(tolerance, length, restarts, key)
    n, m = q.shape[1], 6 if rotation.shape[1] else 3
    work = Work(
        np.empty(n),
        np.empty(n),
        np.empty((3, 3)),
        np.empty(3),
        np.empty((6, n)),
        np.empty(m),
        np.empty((m, m)),
        np.empty(m),
    )
    for row in range(q.shape[0]):
        arm = row if offsets.shape[0] > 1 else 0
        chain = Chain(offsets[arm], axes[arm], prismatic, tool[arm], tool_rotation[arm])
        converged[row] = _inverse(chain, ranges, (rotation[row], position[row]), start[row], settings, work, q[row])


@uncounted
def _inverse(chain, ranges, pose, start, settings, work, q):
    """The posture for one pose into ``q``; returns whether it meets the pose."""
    best = math.inf
    for attempt in range(settings.restarts + 1):
        if attempt == 0:
            _copy(start, work.q)
        else:
            _draw(ranges, settings.key, attempt, work.q)
        _descend(chain, ranges, pose, settings, work)
        if _unwind(chain.prismatic, ranges, start, work.q):
            forward(chain, work.q, work.rotation, work.position)
            _measure_error(pose, settings.length, work)
        error = _square_length(work.error)
        if error < best:
            best = error
            _copy(work.q, q)
        if _is_reached(work.error, settings):
            return True
    return False


@inlined
def _draw(ranges, key, attempt, q):
    """The random posture of an attempt."""
    n = q.shape[0]
    for j in range(n):
        share = 0.5 + 0.5 * uniform(key, np.uint64(attempt * n + j))
        q[j] = min(max(ranges.first[j] + share * (ranges.last[j] - ranges.first[j]), ranges.lower[j]), ranges.upper[j])


@inlined
def _unwind(prismatic, ranges, start, q):
    """Takes full turns off the joints, as the limits allow, so that they end near the start; whether it took any."""
    turn, unwound = 2.0 * math.pi, False
    for j in range(q.shape[0]):
        turns = 0 if prismatic[j] else round((q[j] - start[j]) / turn)
        while turns != 0:
            there = q[j] - turns * turn
            if ranges.lower[j] <= there <= ranges.upper[j]:
                q[j], unwound = there, True
                break
            turns -= 1 if turns > 0 else -1
    return unwound


@uncounted
def _descend(chain, ranges, pose, settings, work):
    """Steps from ``work.q`` until the pose is met or nothing is gained any more; leaves the error where it ends."""
    milestone, waited = math.inf, 0
    for left in range(STEPS, -1, -1):
        forward_and_jacobian(chain, work.q, work.rotation, work.position, work.jacobian)
        _measure_error(pose, settings.length, work)
        if _is_reached(work.error, settings):
            return
        error = _square_length(work.error)
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
        damped_gram(work.jacobian[: work.error.shape[0]], damping, work.gram)
        if not cholesky(work.gram):
            return
        _copy(work.error, work.weights)
        cholesky_solve(work.gram, work.weights)
        if not _hold(ranges, work):
            break
    for j in range(work.q.shape[0]):
        work.q[j] += work.step[j]


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
def _measure_error(pose, length, work):
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
def _is_reached(error, settings):
    """Whether position and orientation both are within the tolerance."""
    most = settings.tolerance * settings.tolerance
    if not error[0] * error[0] + error[1] * error[1] + error[2] * error[2] <= most:
        return False
    if error.shape[0] == 3:
        return True
    angle = error[3] * error[3] + error[4] * error[4] + error[5] * error[5]
    return angle <= most * settings.length * settings.length


@inlined
def _copy(vector, out):
    """Copies a vector."""
    for i in range(out.shape[0]):
        out[i] = vector[i]


@inlined
def _square_length(vector):
    """The squared length of a vector."""
    total = 0.0
    for i in range(vector.shape[0]):
        total += vector[i] * vector[i]
    return total
