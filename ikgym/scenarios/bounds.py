"""Bounds of a scenario: no episode of it fills the memory, and none costs more than floats can add up."""

from __future__ import annotations

import numpy as np

from ikgym import task_kernels
from ikgym.cost import TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.memory import afford, gib
from ikgym.tasks import Task
from ikgym.validation import FloatArray, whole_number

#: Most steps of an episode, and for which one nominal point is held: a day of work at 1 kHz.
MOST_STEPS = 100_000_000
#: An episode costs no more: even squares of costs stay finite.
LARGEST_COST = 1e150


def step_count(name: str, value: int, joints: int) -> int:
    """A number of steps.

    Args:
        name: What it is called in messages.
        value: The number.
        joints: Of the arm, for the memory that the message states.

    Raises:
        InvalidInputError: It is no whole number from 1 to :data:`MOST_STEPS`.
    """
    steps = whole_number(name, value, at_least=1)
    if steps > MOST_STEPS:
        raise InvalidInputError(
            f"{name}: expected a whole number of at most {MOST_STEPS}, got {steps}; so many nominal points would take "
            f"about {gib(bytes_of(steps, joints))} of memory."
        )
    return steps


def bytes_of(points: int, joints: int) -> int:
    """About how much memory the nominal points of an episode take while they are computed."""
    # The joint path, the poses as rotations, positions, frames and a copy, and the numbers of the points.
    return 8 * points * (joints + 3 * 12)


def afford_points(points: int, joints: int) -> None:
    """Insists that there is memory for the nominal points of an episode.

    Raises:
        InvalidInputError: There is not; the message says how much it takes and how much is available.
    """
    afford(f"An episode with {points} nominal points", bytes_of(points, joints))


def largest_step_cost(task: Task, cost: TrackingCost, velocity_limit: FloatArray, distance: float) -> float:
    """The most that one step can cost.

    Args:
        task: The task coordinates.
        cost: The stage cost.
        velocity_limit: What the joint velocities do not exceed, in [rad/s] or [m/s]. Shape (n,).
        distance: What the position error does not exceed, in [m].
    """
    # Parts of two rotations differ by 2 at most; a rotation vector is no longer than π.
    turned = np.pi if task.kind in (task_kernels.POSE, task_kernels.AXIS) else 2.0
    errors = np.array([distance] * 3 + [turned] * (task.error_size - 3))
    return cost.largest(errors, velocity_limit)


def check_cost(name: str, step_cost: float, steps: int) -> None:
    """Insists that the cost of an episode stays finite.

    Args:
        name: The scenario's.
        step_cost: The most that one step can cost.
        steps: Of an episode.

    Raises:
        InvalidInputError: It may exceed :data:`LARGEST_COST`.
    """
    if not steps * step_cost <= LARGEST_COST:  # nor is it NaN
        raise InvalidInputError(
            f"Scenario {name!r}: expected a cost of at most {LARGEST_COST:g} for the worst episode, got "
            f"{steps * step_cost:.3g}; lower the exponents of the cost, the velocity limit or the distances."
        )
