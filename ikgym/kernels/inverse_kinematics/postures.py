"""Kernels: postures for poses, from one start after another."""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels.inverse_kinematics.descent import copy, descend, is_reached, pose_error, square_length
from ikgym.kernels.inverse_kinematics.numbers import Ranges, Settings, Work
from ikgym.kernels.jit import inlined, kernel, uncounted
from ikgym.kernels.kinematics import Chain, forward
from ikgym.kernels.random_numbers import uniform


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
            copy(start, work.q)
        else:
            _draw(ranges, settings.key, attempt, work.q)
        descend(chain, ranges, pose, settings, work)
        if _unwind(chain.prismatic, ranges, start, work.q):
            forward(chain, work.q, work.rotation, work.position)
            pose_error(pose, settings.length, work)
        error = square_length(work.error)
        if error < best:
            best = error
            copy(work.q, q)
        if is_reached(work.error, settings):
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
