"""Kernels: how fast an arm may go along a path that it sees ahead, so that it can slow down in time."""

from __future__ import annotations

import math

import numpy as np

from baselines.solvers.quadratic_program.program import curvature, goal, motion_weight, weigh_rotation
from ikgym.kernels import tasks
from ikgym.kernels.jit import inner, kernel, uncounted
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.kernels.limits import FASTEST
from ikgym.kernels.linear_algebra import cholesky, cholesky_solve

# Most segments in which the path ahead is looked at.
SEGMENTS = 20


@inner
def joint_path_ahead(model, numbers, samples, first, done, now, q, tangents):
    """Tangents of the joint path along the reference ahead: joint motions in one step of the reference.

    They are the smallest in terms of the weights of the joints.

    Args:
        model: The :class:`Model`.
        numbers: The fields of :class:`PathFollowing`.
        samples: Samples of the reference, see :class:`PathMemory`. Shape (L, m).
        first: Number of the last sample that was passed.
        done: Motion of the reference since then. Shape (e,).
        now: Its motion in one step now. Shape (e,).
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        tangents: Receives the tangents, in [rad] or [m], at the place of the arm and at the samples. Shape (s, n).
    """
    n, e, length = q.shape[0], done.shape[0], samples.shape[0]
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    jacobian, move, way, ahead = np.empty((e, n)), np.empty(e), np.empty(e), q.copy()
    hessian, linear, rest, fastest = np.empty((n, n)), np.empty(n), np.zeros(n), model.limits[FASTEST]
    weights, stride = numbers.weights, numbers.stride
    for i in range(tangents.shape[0]):
        here = first + i * stride
        tasks.error(model.kind, samples[(here + 1) % length], samples[here % length], move)
        tasks.error(model.kind, samples[(here + stride) % length], samples[here % length], way)
        if i == 0:
            way -= done
            move[:] = now
        forward_and_jacobian(model.chain, ahead, rotation, position, geometric)
        tasks.jacobian(model.kind, rotation, geometric, jacobian)
        weigh_rotation(model.kind, numbers.rotation_weight, jacobian, move, way)
        weight = motion_weight(jacobian, move, numbers.damping, 0.0, weights, fastest)
        curvature(jacobian, weight, weights, hessian)
        goal(jacobian, move, 0.0, weights, rest, tangents[i])
        goal(jacobian, way, 0.0, weights, rest, linear)
        if cholesky(hessian):
            cholesky_solve(hessian, tangents[i])
            cholesky_solve(hessian, linear)
            ahead += linear


@kernel
def path_speed(tangents, stride, part, last, fastest, change):
    """The largest speed along a path from which the arm can come to rest at its end within its limits.

    The square of the speed is bounded from the end to the start, as in time-optimal path parametrisation (Bobrow,
    Dubowsky and Gibson 1985): by the velocity limits, by the curvature of the joint path, and by the braking possible
    from one place to the next. It grows by no more than the joints can in one step.

    Args:
        tangents: Joint motion for each step of the reference, at the place of the arm and further on. Shape (s, n).
        stride: Steps of the reference from one place to the next.
        part: By how much the first way is shorter.
        last: The speed of the step before.
        fastest: Largest joint motion in one step. Shape (n,).
        change: Largest change of it from step to step. Shape (n,).

    Returns:
        Steps of the reference in a step of time, from 0 to 1.
    """
    square, end, first = 0.0, tangents.shape[0] - 1, stride - part
    for i in range(end, 0, -1):
        square = min(1.0, _largest_square(tangents[i], tangents[min(i + 1, end)], stride, square, change))
        square = min(square, _ceiling(tangents[i - 1], tangents[i], stride if i > 1 else first, fastest, change))
    here, there = tangents[0], tangents[min(1, end)]
    square = min(1.0, _largest_square(here, there, first, square, change))
    gained = 0.5 * (_largest_square(there, here, first, last * last, change) - last * last) / first
    return min(math.sqrt(square), last + max(gained, 0.0))


@uncounted
def _largest_square(tangent, other, steps, square, change):
    """The largest square of the speed at a place, for that at another one some steps of the reference away.

    The joint velocities t ṡ change by less than the time between the places allows: with ṡ₀ ṡ₁ ≈ (ṡ₀² + ṡ₁²) / 2,
    |(t₁ - 3 t₀) ṡ₀² + (3 t₁ - t₀) ṡ₁²| is at most 4 h times the largest change in one step.
    """
    most = math.inf
    for j in range(tangent.shape[0]):
        here, there = other[j] - 3.0 * tangent[j], 3.0 * other[j] - tangent[j]
        if here != 0.0:
            most = min(most, (4.0 * steps * change[j] - math.copysign(1.0, here) * there * square) / abs(here))
    return max(most, 0.0)


@uncounted
def _ceiling(before, tangent, steps, fastest, change):
    """The largest square of the speed at a place: for the velocities there, and for the bend before it."""
    most = 1.0
    for j in range(tangent.shape[0]):
        slope, bend = abs(tangent[j]), abs(tangent[j] - before[j]) / steps
        if slope > 0.0:
            most = min(most, (fastest[j] / slope) ** 2)
        if bend > 0.0:
            most = min(most, change[j] / bend)
    return most
