"""Scenarios as TOML files: reading."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
from collections.abc import Iterator, Mapping
from typing import Any

from ikgym import arms, tasks
from ikgym.arms import Arm
from ikgym.cost import TrackingCost
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.plant import Plant
from ikgym.scenarios.parts import refuse_disturbance
from ikgym.scenarios.scenario import Scenario
from ikgym.scenarios.toml import checked, only_numbers
from ikgym.trajectories import KINDS, Trajectory, from_csv
from ikgym.trajectories.orientations import ORIENTATIONS
from ikgym.validation import known_names

Table = dict[str, Any]

#: The keys of an arm that is read from a URDF file, and what each is.
URDF_TEXTS = {
    "urdf": "a URDF file, relative to this file",
    "name": "a text",
    "base": "the name of a link",
    "tip": "the name of a link",
}
URDF_NUMBERS = ("tool", "tool_rotation")
#: What a URDF file does not hold and the scenario file may add, by the names that :class:`ikgym.Arm` has for it.
ADDED_NUMBERS = ("acceleration_limit", "home")
#: The keys of a trajectory that is read from a CSV file, and what each is; it may have an orientation besides.
CSV_TEXTS = {"file": "a CSV file, relative to this file", "time_law": "the name of a time law"}
CSV_NUMBERS = ("speed", "acceleration", "corner_radius")
#: Bytes of a file that are read at most.
MOST = 2**24


def load(file: str | os.PathLike[str]) -> Scenario:
    """The scenario of a file.

    Args:
        file: A TOML file, as :meth:`Scenario.save` writes it. Paths of other files in it are relative to it.

    Returns:
        The scenario, checked like one that is made in Python.

    Raises:
        InvalidInputError: The file cannot be read, lacks a key, or a value is of a wrong type, length or range; the
            message names file and key.
        UnknownNameError: There is no such key, arm, task or kind of trajectory; the message has the nearest one.
        MissingDependencyError: An arm comes from a URDF file, and Pinocchio is not installed.
    """
    with _named(f"{file}: ", f" in {file}"):
        table = _table(file)
        refuse_disturbance(table)
        known_names("key", table, [f.name for f in dataclasses.fields(Scenario)])
        folder = pathlib.Path(file).parent
        parts: Table = {
            "name": checked(table, "name", str, "a text"),
            "task": tasks.get(checked(table, "task", str, "the name of a task")),
            "arm": _arm(table, "arm", folder),
            "trajectory": _trajectory(checked(table, "trajectory", dict, "a table"), folder),
        }
        if "model" in table:
            parts["model"] = _arm(table, "model", folder)
        if "cost" in table:
            parts["cost"] = _made("cost", TrackingCost, checked(table, "cost", dict, "a table"))
        if "plant" in table:
            parts["plant"] = _plant(checked(table, "plant", dict, "a table"), folder)
        if "source" in table:
            parts["source"] = checked(table, "source", str, "a text")
        numbers = {key: value for key, value in table.items() if key not in parts}
        for key, value in numbers.items():
            only_numbers(key, value)
        return Scenario(**parts, **numbers)


def _table(file: str | os.PathLike[str]) -> Table:
    import tomllib  # seldom needed, and slow to import

    try:
        with pathlib.Path(file).open("rb") as stream:
            content = stream.read(MOST + 1)
        if len(content) > MOST:
            raise ValueError(f"it has more than {MOST} bytes")
        return tomllib.loads(content.decode())
    except tomllib.TOMLDecodeError as error:
        raise InvalidInputError(f"expected TOML, got a fault: {error}.") from None
    except UnicodeDecodeError as error:
        raise InvalidInputError(f"expected a text in UTF-8: {error}.") from None
    except (OSError, TypeError, ValueError, RecursionError) as error:
        raise InvalidInputError(f"expected a TOML file, got none that can be read: {error}.") from None


def _arm(table: Table, key: str, folder: pathlib.Path) -> Arm:
    value = checked(table, key, object, "the name of an arm or a table")
    if isinstance(value, str):
        return arms.get(value)
    arm = checked(table, key, dict, "the name of an arm or a table")
    if "urdf" not in arm:
        # Both are checked by the arm.
        return _made(key, Arm, arm, texts=("name",), truths=("prismatic", "joint_names"))  # type: ignore[no-any-return]
    with _named(f"[{key}] ", f" of [{key}]"):
        known_names("key", arm, (*URDF_TEXTS, *URDF_NUMBERS, *ADDED_NUMBERS))
        for name in set(arm).intersection(URDF_NUMBERS + ADDED_NUMBERS):
            only_numbers(name, arm[name])
        texts = {name: checked(arm, name, str, meant) for name, meant in URDF_TEXTS.items() if name in arm}
        path = folder / texts.pop("urdf")
        found = arms.from_urdf(path, **texts, **{name: arm[name] for name in URDF_NUMBERS if name in arm})
        added = {name: arm[name] for name in ADDED_NUMBERS if name in arm}
        return found.replace(**added) if added else found


def _plant(table: Table, folder: pathlib.Path) -> Plant:
    if "arms" not in table:
        return _made("plant", Plant, table)  # type: ignore[no-any-return]
    with _named("[plant] ", " of [plant]"):
        given = checked(table, "arms", list, "a list of arms")
        found = [_arm({"arms": one}, "arms", folder) for one in given]
    return _made("plant", Plant, {**table, "arms": found}, made=("arms",))  # type: ignore[no-any-return]


def _trajectory(table: Table, folder: pathlib.Path) -> Trajectory:
    kind = _kind("trajectory", table, {**KINDS, "csv": from_csv})
    values = {key: value for key, value in table.items() if key != "kind"}
    if kind is from_csv:
        return _waypoints(values, folder)
    for name, kinds in kind.parts.items():
        if name in values:
            values[name] = _part(name, values, kinds)
    return _made("trajectory", kind, values, texts=kind.texts, made=tuple(kind.parts))  # type: ignore[no-any-return]


def _waypoints(table: Table, folder: pathlib.Path) -> Trajectory:
    """The trajectory through the waypoints of a CSV file; saved again, it is written in numbers."""
    with _named("[trajectory] ", " of [trajectory]"):
        known_names("key", table, (*CSV_TEXTS, *CSV_NUMBERS, "orientation"))
        texts = [name for name in CSV_TEXTS if name in ("file", *table)]
        values: Table = {name: checked(table, name, str, CSV_TEXTS[name]) for name in texts}
        for name in set(table).intersection(CSV_NUMBERS):
            only_numbers(name, table[name])
            values[name] = table[name]
    orientation = _part("orientation", table, ORIENTATIONS) if "orientation" in table else None
    with _named("[trajectory] ", " of [trajectory]"):
        return from_csv(folder / values.pop("file"), orientation=orientation, **values)


def _part(name: str, table: Table, kinds: Mapping[str, type[Any]]) -> Any:
    """A part of a trajectory, made from its table, which says of which kind it is."""
    with _named("[trajectory] ", " of [trajectory]"):
        part = checked(table, name, dict, "a table")
    key = f"trajectory.{name}"
    return _made(key, _kind(key, part, kinds), {k: v for k, v in part.items() if k != "kind"})


def _kind(key: str, table: Table, kinds: Mapping[str, Any]) -> Any:
    """What makes the thing that a table is a description of."""
    with _named(f"[{key}] ", f" of [{key}]"):
        kind = checked(table, "kind", str, f"one of {', '.join(kinds)}")
        known_names("kind", [kind], kinds)
    return kinds[kind]


def _made(
    key: str,
    kind: type[Any],
    table: Mapping[str, Any],
    texts: tuple[str, ...] = (),
    truths: tuple[str, ...] = (),
    made: tuple[str, ...] = (),
) -> Any:
    """A part of a scenario, made from its table; all of its values are numbers but those named."""
    fields = [f for f in dataclasses.fields(kind) if f.init]
    with _named(f"[{key}] ", f" of [{key}]"):
        known_names("key", table, [f.name for f in fields])
        for f in fields:
            if f.default is f.default_factory is dataclasses.MISSING:
                checked(
                    table, f.name, object, "a text" if f.name in texts else "a table" if f.name in made else "numbers"
                )
        for name, value in table.items():
            if name in texts:
                checked(table, name, str, "a text")
            elif name not in truths and name not in made:
                only_numbers(name, value)
        return kind(**table)


@contextlib.contextmanager
def _named(before: str, after: str) -> Iterator[None]:
    """Says in errors which file and which table they are about."""
    try:
        yield
    except UnknownNameError as error:
        raise UnknownNameError(f"{error.kind}{after}", error.name, error.available) from None
    except InvalidInputError as error:
        raise InvalidInputError(f"{before}{error}") from None
