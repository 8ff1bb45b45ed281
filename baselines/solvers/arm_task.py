"""What kernels are told of an arm and its task, as one block of numbers; and the task shift of one row.

Policies hand plain values to their kernels, which take them apart before their loop. Measured on one core, for a
kernel with 22 values in four groups: 4.9 µs a call with named tuples from Python, 1.6 µs with plain tuples, 1.8 µs with
flat arguments; an array takes 0.12 to 0.17 µs, so that arm and task are a single one. Inside an iteration arrays are
used one by one: a tuple counts the references of all its arrays each time it is passed or a field is read (`mfac` in
varga7-fast: 44 µs instead of 29 with tuples throughout, 31.6 with the forward kinematics and the Jacobian of the task
in one function that takes two tuples).
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym import task_kernels
from ikgym.jit import inlined, kernel
from ikgym.kinematics import Chain

if TYPE_CHECKING:
    from baselines.policy import Problem

Floats = npt.NDArray[np.float64]


class ArmTask(NamedTuple):
    """The model of the arm and the task coordinates as kernels see them.

    Attributes:
        chain: The model of the arm.
        kind: The kind of task coordinates, one of those of :mod:`ikgym.task_kernels`.
    """

    chain: Chain
    kind: int


class Observed(NamedTuple):
    """What kernels see of the observations of B arms.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        nominal: Nominal task coordinates, of the next step, or of p steps ahead. Shape (B, m) or (B, p, m).
    """

    q: Floats
    pose: Floats
    nominal: Floats


@functools.lru_cache(64)  # problems are frozen, and asked for at each step
def plain_arm_task(problem: Problem) -> Floats:
    """The :class:`ArmTask` of a problem as one read-only block.

    Joints, kind of task and Δt; the scale of actions; least and largest joint coordinates and largest velocities; then
    the parts of the chain.
    """
    model = problem.model
    limits = problem.velocity_limit, model.lower, model.upper, problem.largest_qdot
    block = np.concatenate([[model.joints, problem.task.kind, problem.dt], *limits, *map(np.ravel, model.chain)])
    block.flags.writeable = False
    return block


@inlined
def period_of(block):
    """Δt in [s] and what an action of 1 means, in [rad/s] or [m/s], of shape (n,), from :func:`plain_arm_task`."""
    return block[2], block[3 : 3 + int(block[0])]


@inlined
def arm_task_of(block):
    """The :class:`ArmTask` that :func:`plain_arm_task` took apart."""
    n = int(block[0])
    axes, prismatic, tool, rotation = 3 + 7 * n, 3 + 10 * n, 3 + 11 * n, 6 + 11 * n
    chain = Chain(
        block[3 + 4 * n : axes].reshape(n, 3),
        block[axes:prismatic].reshape(n, 3),
        block[prismatic:tool] != 0.0,
        block[tool:rotation],
        block[rotation:].reshape(3, 3),
    )
    return ArmTask(chain, int(block[1]))


@inlined
def joint_limits_of(block):
    """Least and largest joint coordinates and largest velocities, of shapes (n,), from :func:`plain_arm_task`."""
    n = int(block[0])
    return block[3 + n : 3 + 2 * n], block[3 + 2 * n : 3 + 3 * n], block[3 + 3 * n : 3 + 4 * n]


@inlined
def pose_arrays(n, m):
    """Arrays for one pose: rotation (3, 3), position (3,), geometric Jacobian (6, n) and task coordinates (m,)."""
    return np.empty((3, 3)), np.empty(3), np.empty((6, n)), np.empty(m)


@kernel
def task_shift(kind, gain, pose, target, present, error, shift):
    """Δx = (X^N(k+1) - X^N(k)) + gain (X^N(k) - x(k)) of one row; ``error`` (e,) receives the last difference."""
    motion_and_error(kind, pose, target, present, shift, error)
    add_feedback(gain, error, shift)


@inlined
def motion_and_error(kind, pose, target, present, motion, error):
    """The differences X^N(k+1) - X^N(k) and X^N(k) - x(k) of one row, both of shape (e,)."""
    task_kernels.error(kind, target, present, motion)
    task_kernels.error(kind, present, pose, error)


@inlined
def add_feedback(gain, error, shift):
    """Adds a share of the error to a task shift of one row, both of shape (e,)."""
    for i in range(error.shape[0]):
        shift[i] += gain * error[i]
