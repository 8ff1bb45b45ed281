"""The parts of a scenario: each is what it has to be, and they fit together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ikgym.arms import Arm
from ikgym.cost import TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.plant import Plant
from ikgym.tasks import Task
from ikgym.trajectories import Trajectory

KINDS = {"arm": Arm, "task": Task, "trajectory": Trajectory, "cost": TrackingCost, "plant": Plant}


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


def refuse_disturbance(given: Mapping[str, Any]) -> None:
    """Says where the drives' bias and noise belong to those who give them by the name that they once had.

    Raises:
        InvalidInputError: There is a `disturbance`.
    """
    if "disturbance" in given:
        raise InvalidInputError(
            "disturbance: expected its bias and noise in plant, as in plant=ikgym.Plant(bias=…, noise=…) or a table "
            f"[plant], got {given['disturbance']!r}."
        )


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
