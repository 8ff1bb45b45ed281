"""The size of an arm, from which parameters with a length in their unit take their defaults."""

from __future__ import annotations

import math

import numpy as np

from ikgym.arms import Arm
from ikgym.kernels import tasks as task_kernels
from ikgym.tasks import Task
from ikgym.validation import FloatArray

# Factor from a length in [m] to the square of :func:`radian`, in [m]: measured, see there.
RADIAN = 0.28
# ‖∂x/∂q‖² of the orientation's numbers for a joint that turns at 1 rad/s, at most.
_TURNING = {
    task_kernels.POSITION: 0.0,
    task_kernels.SKEW: 1.0,
    task_kernels.MATRIX: 2.0,
    task_kernels.POSE: 1.0,
    task_kernels.AXIS: 1.0,
}


def length(arm: Arm) -> float:
    """The arm's length from its first joint to the tool in [m]: that of all links, prismatic joints at home."""
    return float(_levers(arm)[0])


def radian(arm: Arm) -> float:
    """Weight of an error of 1 rad against one of position, in [m], for steps along Jᵀ.

    The square root of length times 0.28 m. Joints turn positions by 0.3 times the length or so, and with that much for
    1 rad both parts of the error would go back equally fast; but in the cost 1 m counts as much as 1 rad, whatever the
    size. The geometric mean of both is within a third of the best on arms of 1 to 21 m. An arm without length has 1 m.
    """
    return math.sqrt(RADIAN * length(arm)) or 1.0


def error_weights(task: Task, metres: float) -> FloatArray:
    """Weights of the squares of the error's components, in [m²] of the position's.

    Args:
        task: The task coordinates.
        metres: Weight of 1 rad, or of 1 in a rotation matrix, in [m].

    Returns:
        1 for components of the position, the square of ``metres`` for others. Shape (e,).
    """
    weights = np.full(task.error_size, metres * metres)
    # The position is first with rotation vectors and axes, last with parts of a matrix.
    weights[slice(0, 3) if task.kind in (task_kernels.POSE, task_kernels.AXIS) else slice(-3, None)] = 1.0
    return weights


def jacobian_bound(arm: Arm, task: Task | None, metres: float = 1.0) -> float:
    """A number that ‖∂x/∂q‖² does not exceed: the sum over the joints of the largest ‖∂x/∂q_j‖², by the links' lengths.

    Args:
        arm: The arm; its prismatic joints are taken to be at home.
        task: The task coordinates x; None for a position alone.
        metres: Weight of 1 rad, in [m].
    """
    turning = 0.0 if task is None else _TURNING[task.kind] * metres * metres
    return float(np.where(arm.prismatic, 1.0, _levers(arm) ** 2 + turning).sum())


def _levers(arm: Arm) -> FloatArray:
    """Largest distance of the tool from each joint, in [m]. Shape (n,)."""
    links = np.append(np.linalg.norm(arm.offsets[1:], axis=1), np.linalg.norm(arm.tool))
    levers: FloatArray = np.cumsum(links[::-1])[::-1]
    return levers
