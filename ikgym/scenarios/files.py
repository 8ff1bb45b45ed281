"""Scenarios as TOML files: one walker over the fields of dataclasses reads and writes all of their parts."""

from __future__ import annotations

import dataclasses
import inspect
import json
import logging
import os
import pathlib
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ikgym import arms, files, tasks
from ikgym.arms import Arm
from ikgym.arms.arm import FACTS, numbered_joints
from ikgym.arms.bodies import Bodies
from ikgym.cost import ProximityCost, TrackingCost
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.obstacles import KINDS as OBSTACLES
from ikgym.obstacles import MOST_OBSTACLES, Obstacle
from ikgym.plant import Plant
from ikgym.tasks import Task
from ikgym.trajectories import KINDS, TimeLaw, Trajectory, from_csv
from ikgym.trajectories.orientations import ORIENTATIONS, Orientation
from ikgym.trajectories.paths import PATHS, Path
from ikgym.trajectories.time_laws import TIME_LAWS
from ikgym.validation import add_location, known_names

logger = logging.getLogger("ikgym")

Table = dict[str, Any]

#: Parts of several kinds: their classes by the values of the key `kind`.
CHOICES: dict[type, Mapping[str, Callable[..., Any]]] = {
    Trajectory: {**KINDS, "csv": from_csv},
    Path: PATHS,
    TimeLaw: TIME_LAWS,
    Orientation: ORIENTATIONS,
    Obstacle: OBSTACLES,
}
PARTS = (Arm, Bodies, Task, TrackingCost, ProximityCost, Plant, *CHOICES)
#: Classes in the annotations of texts.
TEXTS = {str, type(None), os.PathLike[str]}


def arguments(
    make: Callable[..., Any], table: Table, folder: pathlib.Path, where: str = "", like: bool = False
) -> Table:
    """The arguments of a dataclass or a function, from a table.

    Args:
        make: The class or the function; its annotations say which arguments are parts, which are tables.
        table: Keys are names of arguments.
        folder: Paths of other files are relative to it.
        where: Name of the table in messages.
        like: Whether arguments without a default may be missing.
    """
    parameters, hints = inspect.signature(make).parameters, typing.get_type_hints(make)
    with add_location(where):
        known_names("key", table, parameters)
        for name, parameter in parameters.items():
            if parameter.default is parameter.empty and name not in table and not like:
                raise InvalidInputError(f"{name}: expected {_meaning(hints[name])}, got no such key.")
    return {name: _value(hints[name], name, value, folder, where) for name, value in table.items()}


def _value(hint: Any, name: str, value: Any, folder: pathlib.Path, where: str) -> Any:
    """The value of an argument with some annotation."""
    kind = _part(hint)
    if kind is not None and isinstance(value, list) and typing.get_origin(hint) is Sequence:
        if kind is Obstacle and len(value) > MOST_OBSTACLES:
            with add_location(where):
                raise InvalidInputError(f"{name}: expected at most {MOST_OBSTACLES} tables, got {len(value)}.")
        return [_value(kind, name, one, folder, where) for one in value]
    with add_location(where):
        if kind is None or kind is Task or (hint is Arm and isinstance(value, str)):
            if (_meaning(hint) == "a text" or kind is Arm) and not isinstance(value, str):
                raise InvalidInputError(f"{name}: expected a text, got {value!r}.")
            return tasks.get(value) if kind is Task else arms.get(value) if kind is Arm else value
        if typing.get_origin(hint) is Sequence or not isinstance(value, dict):
            raise InvalidInputError(f"{name}: expected {_meaning(hint)}, got {value!r}.")
    where = f"{where}.{name}" if where else name
    if kind is Arm:
        return _arm(value, folder, where)
    make: Callable[..., Any] = kind
    if kind in CHOICES:
        with add_location(where):
            make = _choice(CHOICES[kind], value)
        value = {key: part for key, part in value.items() if key != "kind"}
    given = arguments(make, value, folder, where)
    with add_location(where):
        if make is from_csv:
            given["file"] = folder / given["file"]
        return make(**given)


def _arm(table: Table, folder: pathlib.Path, where: str) -> Arm:
    """An arm in numbers, from a URDF file, or like another one; the last two with other fields replaced."""
    make: Callable[..., Arm] = Arm
    given, changes = table, {}
    if "like" in table:
        make, given = arms.get, {"name": table["like"]}
        changes = {key: value for key, value in table.items() if key != "like"}
    elif "urdf" in table:
        make = arms.from_urdf
        of_file = ("name", "base", "tip", "tool", "tool_rotation", "meshes", "packages", "bodyless")
        with add_location(where):
            known_names("key", table, dict.fromkeys(("urdf", *of_file, *inspect.signature(Arm).parameters)))
        given = {"path": table["urdf"], **{key: table[key] for key in of_file if key in table}}
        changes = {key: value for key, value in table.items() if key not in ("urdf", *of_file)}
    given = arguments(make, given, folder, where)
    changes = arguments(Arm, changes, folder, where, like=True)
    with add_location(where):
        if make is arms.from_urdf:
            given["path"] = folder / given["path"]
            packages = given.get("packages")
            if isinstance(packages, str):
                given["packages"] = folder / packages
            elif isinstance(packages, list):
                given["packages"] = [folder / one if isinstance(one, str) else one for one in packages]
        arm = make(**given)
        changed = arm.replace(**changes) if changes else arm
    if arm.urdf is not None and changed.urdf is None:
        keys = ", ".join(sorted(changes.keys() - FACTS))
        logger.warning(
            "[%s] %s: the arm differs from its file %s, whose meshes are not shown.", where, keys, arm.urdf.file
        )
    return changed


def _choice(kinds: Mapping[str, Any], table: Table) -> Any:
    if not isinstance(table.get("kind"), str):
        got = repr(table["kind"]) if "kind" in table else "no such key"
        raise InvalidInputError(f"kind: expected one of {', '.join(kinds)}, got {got}.")
    known_names("kind", [table["kind"]], kinds)
    return kinds[table["kind"]]


def _part(hint: Any) -> type | None:
    """The class of a part that an annotation names."""
    return next((kind for kind in (hint, *typing.get_args(hint)) if kind in PARTS), None)


def _meaning(hint: Any) -> str:
    """Description of a value for messages."""
    kind, classes = _part(hint), set(typing.get_args(hint))
    if kind is Arm:
        return "the name of an arm or a table" if hint is Arm else "a list of arms"
    if kind is not None and typing.get_origin(hint) is Sequence:
        return "a list of tables"
    if kind is Task or hint is str or (typing.get_origin(hint) is not Sequence and {str} <= classes <= TEXTS):
        return "a text"
    return "numbers" if kind is None else "a table"


def save(fields: Mapping[str, Any], file: str | os.PathLike[str]) -> None:
    """Writes the fields of a scenario to a file, in one go."""
    try:
        path = pathlib.Path(file)
    except TypeError:
        raise InvalidInputError(f"file: expected a path that ends in .toml, got {file!r}.") from None
    if path.suffix != ".toml":
        raise InvalidInputError(f"file: expected a path that ends in .toml, got {str(file)!r}.")
    try:
        values = {name: _plain(value, path.parent) for name, value in fields.items()}
        if fields["model"] is fields["arm"]:
            values["model"] = None
        content = document(values).encode()
    except (InvalidInputError, UnicodeEncodeError) as error:
        raise InvalidInputError(f"Scenario {fields['name']!r} cannot be written: {error}") from None
    try:
        files.write(path, content)
    except (OSError, ValueError) as error:
        raise InvalidInputError(f"Cannot write {path}: {error}.") from None


def _plain(value: Any, folder: pathlib.Path) -> Any:
    """A value in texts, numbers, arrays and tables of them."""
    if isinstance(value, Task):
        if value.name not in tasks.names() or value != tasks.get(value.name):
            raise InvalidInputError(f"task: expected one of {', '.join(tasks.names())}, got {value!r}.")
        return value.name
    if isinstance(value, tuple) and value and isinstance(value[0], PARTS):
        return [_plain(one, folder) for one in value]
    if not isinstance(value, PARTS):
        return value
    for base, kinds in CHOICES.items():
        if isinstance(value, base):
            name = next((name for name, kind in kinds.items() if type(value) is kind), None)
            if name is None:
                raise InvalidInputError(
                    f"expected one of the kinds {', '.join(kinds)}, got a {type(value).__name__}, which a file cannot "
                    "hold. A scenario in Python is named by 'package.module:attribute'."
                )
            return {"kind": name, **_fields(value, folder)}
    if type(value) not in PARTS:
        raise InvalidInputError(f"expected a class of ikgym, got {type(value).__name__}, which a file cannot hold.")
    if isinstance(value, Arm):
        return _plain_arm(value, folder)
    fields = _fields(value, folder)
    if isinstance(value, Plant):
        return {name: fields[name] for name in value.switched_on()} or None
    return fields if not isinstance(value, Bodies) or len(value) or value.unseen else None


def _fields(part: Any, folder: pathlib.Path) -> Table:
    return {f.name: _plain(getattr(part, f.name), folder) for f in dataclasses.fields(part) if f.init}


def _plain_arm(arm: Arm, folder: pathlib.Path) -> str | Table:
    """The name of an arm of this package, a reference to a URDF file, or numbers."""
    if arm.name in arms.SHIPPED and _same(arm, arms.get(arm.name)):
        return arm.name
    numbers = _fields(arm, folder)
    if not np.isfinite(arm.jerk_limit).any():
        del numbers["jerk_limit"]
    if arm.joint_names == numbered_joints(arm.joints):
        del numbers["joint_names"]
    return _urdf(arm, folder) or numbers


def _urdf(arm: Arm, folder: pathlib.Path) -> Table | None:
    """A reference to the URDF file of an arm, with what it states otherwise; None where there is none, or it moved."""
    if arm.urdf is None:
        return None
    names = ("base", "tip", "tool", "tool_rotation", "meshes", "packages", "bodyless")
    where: Table = {name: getattr(arm.urdf, name) for name in names}
    try:
        read = arms.from_urdf(arm.urdf.file, name=arm.name, **where)
        stated = {name: getattr(arm, name) for name in FACTS if _bytes(arm, [name]) != _bytes(read, [name])}
        if not _same(arm, read.replace(**stated)):
            return None
    except IkgymError:
        return None
    where["meshes"] = where["meshes"] or None  # keys without a value are left out
    where["packages"] = [_relative(one, folder) for one in where["packages"]] or None
    where["bodyless"] = list(where["bodyless"]) or None
    return {"name": arm.name, "urdf": _relative(arm.urdf.file, folder), **where, **stated}


def _relative(path: pathlib.Path, folder: pathlib.Path) -> str:
    """A path as it is seen from a folder; on another drive the path itself."""
    try:
        return pathlib.Path(os.path.relpath(path, folder.resolve())).as_posix()
    except ValueError:
        return path.as_posix()


def _same(one: Arm, other: Arm) -> bool:
    """Whether two arms are the same bit for bit, names aside."""
    return _bytes(one) == _bytes(other) and _bytes(one.bodies) == _bytes(other.bodies)


def _bytes(part: Arm | Bodies, names: Iterable[str] = ()) -> list[bytes]:
    fields = names or [f.name for f in dataclasses.fields(part) if f.init and f.name not in ("name", "bodies")]
    return [np.asarray(getattr(part, name)).tobytes() for name in fields]


def document(values: Mapping[str, Any]) -> str:
    """The text of a TOML file, in which every number reads as the very same number.

    Values are texts, truth values, numbers, arrays, sequences of them, and mappings, which become tables; None is left
    out. Keys consist of letters, digits and ``_``.
    """
    return "\n".join(_lines(values, "")) + "\n"


def _lines(values: Mapping[str, Any], within: str) -> list[str]:
    """The lines of a table, plain values before tables."""
    given = {key: value for key, value in values.items() if value is not None}
    lines = [f"{key} = {_text(value)}" for key, value in given.items() if not isinstance(value, Mapping)]
    for key, value in given.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{within}{key}]", *_lines(value, f"{within}{key}.")]
    return lines


def _text(value: Any) -> str:
    if isinstance(value, str):
        # JSON escapes all that TOML wants escaped but the character 127.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return repr(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, Mapping):  # in a list of tables
        return "{ " + ", ".join(f"{key} = {_text(part)}" for key, part in value.items() if part is not None) + " }"
    if isinstance(value, np.ndarray) and value.ndim > 1:
        return "[\n" + "".join(f"  {_text(row)},\n" for row in value) + "]"
    if isinstance(value, Iterable):
        return "[" + ", ".join(map(_text, value)) + "]"
    raise TypeError(f"{value!r} has no form in TOML.")  # a fault of ours: callers pass nothing else
