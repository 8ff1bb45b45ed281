"""Checks of a scenario: its parts fit together, and no episode exceeds the memory or the range of floats."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ikgym.cost import TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.kernels import tasks as task_kernels
from ikgym.machine import check_memory, gib
from ikgym.obstacles import Obstacle
from ikgym.tasks import Task
from ikgym.validation import FloatArray, flag, known_names, shortened, whole_number

#: Most steps of an episode, and for which one nominal point is held: a day of work at 1 kHz.
MOST_STEPS = 100_000_000
#: An episode costs no more: even squares of costs stay finite.
LARGEST_COST = 1e150
#: More obstacles than a scenario has.
MOST_OBSTACLES = 1000


def check_parts(fields: Mapping[str, Any]) -> None:
    """Checks that model, task and trajectory of a scenario suit its arm."""
    name, arm, model, task = (fields[key] for key in ("name", "arm", "model", "task"))
    if model.joints != arm.joints:
        got = f"{model.name!r} with {model.joints}"
        raise InvalidInputError(f"model of scenario {name!r}: expected an Arm with {arm.joints} joints, got {got}.")
    fields["trajectory"].check(model)
    if task.has_orientation and not fields["trajectory"].has_orientation:
        raise InvalidInputError(f"Scenario {name!r}: task {task.name!r} needs orientations, the trajectory has none.")


def obstacles(fields: Mapping[str, Any]) -> tuple[Obstacle, ...]:
    """The obstacles of a scenario, whose other parts are checked already."""
    name, arm, given, collisions = (fields[key] for key in ("name", "arm", "obstacles", "collisions"))
    if not isinstance(given, (tuple, list)) or not all(isinstance(one, Obstacle) for one in given):
        raise InvalidInputError(
            f"obstacles of scenario {name!r}: expected a list of obstacles, got {shortened(given)}."
        )
    if (count := sum(one.count for one in given)) > MOST_OBSTACLES:
        raise InvalidInputError(f"obstacles of scenario {name!r}: expected at most {MOST_OBSTACLES}, got {count}.")
    names = (*arm.bodies.names, *(one for obstacle in given for one in obstacle.names))
    if twice := {one for one in names if names.count(one) > 1}:
        raise InvalidInputError(
            f"obstacles of scenario {name!r}: expected names that differ from each other and from those of bodies, got "
            f"{min(twice)!r} twice."
        )
    for one in given:
        known_names("body", one.ignored, arm.bodies.names)
    path = fields["trajectory"]
    if any(one.random for one in given) and not (path.random and path.joint_bound() is not None):
        raise InvalidInputError(
            f"obstacles of scenario {name!r}: expected the trajectory of a random joint motion, which drawn boxes "
            f"keep clear, got a {type(path).__name__}."
        )
    matters = bool(given) if collisions is None else flag("collisions", collisions)
    if matters:
        arm.bodies.check_seen(arm.name)
    if matters and not len(arm.bodies):
        raise InvalidInputError(f"collisions of scenario {name!r}: expected an arm with bodies, {arm.name!r} has none.")
    _check_proximity(name, fields["proximity"], matters)
    return tuple(given)


def _check_proximity(name: str, cost: Any, matters: bool) -> None:
    if cost is not None and not matters:
        raise InvalidInputError(
            f"proximity of scenario {name!r}: expected a scenario with collisions, got one without; they are switched "
            "on by obstacles, or by collisions = true."
        )


def step_count(name: str, value: int, joints: int) -> int:
    """A number of steps; the message states the memory for so many joints."""
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


def check_memory_of_points(points: int, joints: int) -> None:
    """Checks that there is memory for the nominal points of an episode."""
    check_memory(f"The {points} nominal points of an episode", bytes_of(points, joints))


def largest_step_cost(task: Task, cost: TrackingCost, velocity_limit: FloatArray, distance: float) -> float:
    """The most that one step can cost at the largest joint velocities and a position error in [m]."""
    # Parts of two rotations differ by 2 at most; a rotation vector is no longer than π.
    turned = np.pi if task.kind in (task_kernels.POSE, task_kernels.AXIS) else 2.0
    errors = np.array([distance] * 3 + [turned] * (task.error_size - 3))
    return cost.largest(errors, velocity_limit)


def check_cost(name: str, step_cost: float, steps: int) -> None:
    """Checks that the cost of an episode stays finite, by the most that one step can cost."""
    if not steps * step_cost <= LARGEST_COST:  # nor is it NaN
        raise InvalidInputError(
            f"Scenario {name!r}: expected a cost of at most {LARGEST_COST:g} for the worst episode, got "
            f"{steps * step_cost:.3g}; lower the exponents of the cost, the velocity limit or the distances."
        )
