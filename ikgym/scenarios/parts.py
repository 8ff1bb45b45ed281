"""The parts of a scenario: each is what it has to be, and they fit together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ikgym.arms import Arm
from ikgym.cost import TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios.disturbance import Disturbance
from ikgym.tasks import Task
from ikgym.trajectories import Trajectory

KINDS = {"arm": Arm, "task": Task, "trajectory": Trajectory, "cost": TrackingCost, "disturbance": Disturbance}


def check_kinds(fields: Mapping[str, Any]) -> None:
    """Insists that the fields of a scenario are objects of their kinds, and its texts texts.

    Raises:
        InvalidInputError: One is something else.
    """
    for field, kind in KINDS.items():
        if not isinstance(fields[field], kind):
            raise InvalidInputError(
                f"{field} of scenario {fields['name']!r}: expected {kind.__name__}, got {fields[field]!r}."
            )
    for field in ("name", "source"):
        if not isinstance(fields[field], str):
            raise InvalidInputError(f"{field} of a scenario: expected a text, got {fields[field]!r}.")


def check_model(name: str, model: object, joints: int) -> None:
    """Insists that the model of a scenario is an arm with as many joints as the one that moves.

    Raises:
        InvalidInputError: It is not.
    """
    if not isinstance(model, Arm) or model.joints != joints:
        got = f"{model.name!r} with {model.joints}" if isinstance(model, Arm) else repr(model)
        raise InvalidInputError(f"model of scenario {name!r}: expected an Arm with {joints} joints, got {got}.")


def check_orientation(name: str, task: Task, trajectory: Trajectory) -> None:
    """Insists that the trajectory has orientations where the task needs them.

    Raises:
        InvalidInputError: It has none.
    """
    if task.has_orientation and not trajectory.has_orientation:
        raise InvalidInputError(f"Scenario {name!r}: task {task.name!r} needs orientations, the trajectory has none.")
