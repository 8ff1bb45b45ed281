"""What kernels are told of an arm and its task, as plain tuples; and the task shift of one row.

Policies hand plain tuples to their kernels, which take them apart before their loop. Measured on one core, for a
kernel with 22 values in four groups: 4.9 µs a call with named tuples from Python, 1.6 µs with plain tuples, 1.8 µs with
flat arguments. Inside an iteration arrays are used one by one: a tuple counts the references of all its arrays each
time it is passed or a field is read (`mfac` in varga7-fast: 44 µs instead of 29 with tuples throughout, 31.6 with the
forward kinematics and the Jacobian of the task in one function that takes two tuples).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ikgym import task_kernels
from ikgym.jit import inlined, kernel
from ikgym.kinematics import Chain
from ikgym.validation import FloatArray

if TYPE_CHECKING:
    from baselines.policy import Problem


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

    q: FloatArray
    pose: FloatArray
    nominal: FloatArray


def plain_arm_task(problem: Problem) -> tuple[Any, ...]:
    """The :class:`ArmTask` of a problem as plain tuples."""
    return tuple(problem.model.chain), problem.task.kind


@inlined
def arm_task_of(plain):
    """The :class:`ArmTask` that :func:`plain_arm_task` took apart."""
    return ArmTask(Chain(*plain[0]), plain[1])


@inlined
def pose_arrays(n, m):
    """Arrays for one pose: rotation (3, 3), position (3,), geometric Jacobian (6, n) and task coordinates (m,)."""
    return np.empty((3, 3)), np.empty(3), np.empty((6, n)), np.empty(m)


@kernel
def task_shift(kind, gain, pose, target, present, error, shift):
    """Δx = (X^N(k+1) - X^N(k)) + gain (X^N(k) - x(k)) of one row; ``error`` (e,) receives the last difference."""
    task_kernels.error(kind, target, present, shift)
    task_kernels.error(kind, present, pose, error)
    for i in range(error.shape[0]):
        shift[i] += gain * error[i]
