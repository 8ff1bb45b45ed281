"""Scenarios as TOML files: writing. What is written, :mod:`ikgym.scenarios.reading` reads."""

from __future__ import annotations

import dataclasses
import os
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from ikgym import arms, files, tasks
from ikgym.arms import Arm
from ikgym.arms.checks import numbered_joints
from ikgym.cost import TrackingCost
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.plant import Plant
from ikgym.scenarios.toml import document
from ikgym.tasks import Task
from ikgym.trajectories import KINDS, Trajectory


def save(scenario: Mapping[str, Any], file: str | os.PathLike[str]) -> None:
    """Writes a scenario to a file, in one go.

    Args:
        scenario: The fields of the scenario.
        file: A name that ends in ``.toml``.

    Raises:
        InvalidInputError: A part of the scenario has no form in a file, or the file cannot be written. There is no
            new file then, and an old one stays as it was.
    """
    try:
        path = pathlib.Path(file)
    except TypeError:
        raise InvalidInputError(f"file: expected a path that ends in .toml, got {file!r}.") from None
    if path.suffix != ".toml":
        raise InvalidInputError(f"file: expected a path that ends in .toml, got {str(file)!r}.")
    try:
        content = document(_values(scenario, path.parent)).encode()
        files.write(path, content)
    except InvalidInputError as error:
        raise InvalidInputError(f"Scenario {scenario['name']!r} cannot be written: {error}") from None
    except UnicodeEncodeError as error:
        raise InvalidInputError(f"Scenario {scenario['name']!r} cannot be written: {error}.") from None
    except (OSError, ValueError) as error:
        raise InvalidInputError(f"Cannot write {path}: {error}.") from None


def _values(scenario: Mapping[str, Any], folder: pathlib.Path) -> dict[str, Any]:
    """The scenario in texts, numbers, arrays and tables of them; checked whole, before anything is written."""
    arm, model = scenario["arm"], scenario["model"]
    return {
        **scenario,
        "arm": _arm(arm, folder),
        "model": None if model is arm else _arm(model, folder),
        "task": _task(scenario["task"]),
        "trajectory": _trajectory(scenario["trajectory"]),
        "cost": _parameters("cost", scenario["cost"], TrackingCost),
        "plant": _plant(scenario["plant"], folder),
    }


def _arm(arm: Arm, folder: pathlib.Path) -> str | dict[str, Any]:
    """The name of an arm of this package, a reference to a URDF file, or numbers."""
    numbers = _parameters(f"arm {arm.name!r}", arm, Arm)
    if not isinstance(arm.name, str):
        raise InvalidInputError(f"name of the arm: expected a text, got {arm.name!r}.")
    if arm.name in arms.SHIPPED and _same(arm, arms.get(arm.name)):
        return arm.name
    if arm.joint_names == numbered_joints(arm.joints):
        del numbers["joint_names"]
    return _urdf(arm, folder) or numbers


def _urdf(arm: Arm, folder: pathlib.Path) -> dict[str, Any] | None:
    """Where an arm was read from; None where that is no file, or one that has changed since."""
    if arm.urdf is None:
        return None
    path, base, tip, tool, tool_rotation = arm.urdf
    try:
        again = arms.from_urdf(path, base=base, tip=tip, name=arm.name, tool=tool, tool_rotation=tool_rotation)
    except IkgymError:
        return None
    if not _same(arm, again):
        return None
    try:
        name = os.path.relpath(path, folder.resolve())
    except ValueError:  # on another drive
        name = str(path)
    return {
        "name": arm.name,
        "urdf": pathlib.Path(name).as_posix(),
        "base": base,
        "tip": tip,
        "tool": tool,
        "tool_rotation": tool_rotation,
    }


def _plant(plant: Plant, folder: pathlib.Path) -> dict[str, Any] | None:
    """What is switched on; None where nothing is."""
    _parameters("plant", plant, Plant)  # says whether a file can hold it
    given = plant.switched_on()
    if plant.arms:
        given["arms"] = [_arm(one, folder) for one in plant.arms]
    return given or None


def _task(task: Task) -> str:
    if task.name not in tasks.names() or task != tasks.get(task.name):
        raise InvalidInputError(
            f"task: expected one of {', '.join(tasks.names())}, which a file can name, got {task!r}."
        )
    return task.name


def _trajectory(trajectory: Trajectory) -> dict[str, Any]:
    for kind, known in KINDS.items():
        if type(trajectory) is known:
            parameters = _parameters("trajectory", trajectory, known)
            for name, kinds in trajectory.parts.items():
                if parameters[name] is not None:
                    parameters[name] = _part(name, parameters[name], kinds)
            return {"kind": kind, **parameters}
    raise InvalidInputError(
        f"trajectory: expected one of {', '.join(k.__name__ for k in KINDS.values())}, which a file can hold, got a "
        f"{type(trajectory).__name__}. A scenario in Python is named by 'package.module:attribute'."
    )


def _part(name: str, part: Any, kinds: Mapping[str, type]) -> dict[str, Any]:
    """A part of a trajectory, with the name of its kind."""
    for kind, known in kinds.items():
        if type(part) is known:
            return {"kind": kind, **_parameters(name, part, known)}
    raise InvalidInputError(
        f"{name} of the trajectory: expected one of {', '.join(k.__name__ for k in kinds.values())}, which a file can "
        f"hold, got a {type(part).__name__}."
    )


def _parameters(name: str, part: Any, kind: type[Any]) -> dict[str, Any]:
    """All that a part is made with; a class derived from the known one may hold what no file can."""
    if type(part) is not kind:
        raise InvalidInputError(
            f"{name}: expected {kind.__name__} itself, got {type(part).__name__}, which a file cannot hold."
        )
    return {f.name: getattr(part, f.name) for f in dataclasses.fields(kind) if f.init}


def _same(one: Arm, other: Arm) -> bool:
    """Whether two arms are the same bit for bit, names aside."""
    return all(
        np.asarray(getattr(one, f.name)).tobytes() == np.asarray(getattr(other, f.name)).tobytes()
        for f in dataclasses.fields(Arm)
        if f.init and f.name != "name"
    )
