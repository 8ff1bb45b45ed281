"""The arms of ``arms.toml``: those of papers and of makers, with their sources."""

from __future__ import annotations

import functools
import os
import pathlib
import tomllib
from collections.abc import Callable
from typing import Any

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.bodies import Bodies
from ikgym.validation import FloatArray

FILE = pathlib.Path(__file__).with_name("arms.toml")
#: Keys of a table that are no fields of an arm, nor of its bodies.
ABOUT = ("source", "licence", "like")


def read(file: str | os.PathLike[str] = FILE) -> dict[str, Callable[[], Arm]]:
    """The arms of a file, each made when its function is called.

    Args:
        file: A TOML file with one table an arm, whose keys are the fields of :class:`ikgym.Arm`. Axes may be words such
            as ``"z -y x"``. The key `like` names another arm of the file, which supplies the missing fields; bodies are
            added to those of that arm.
    """
    tables = tomllib.loads(pathlib.Path(file).read_text(encoding="utf-8"))
    return {name: functools.partial(_arm, name, tables) for name in tables}


def _arm(name: str, tables: dict[str, Any]) -> Arm:
    table = tables[name]
    like = tables[table["like"]] if "like" in table else {}
    fields = _fields(like | table)
    if isinstance(fields["axes"], str):
        fields["axes"] = directions(fields["axes"])
    if "bodies" in fields:
        fields["bodies"] = _bodies(like.get("bodies", {}), table.get("bodies", {}))
    return Arm(name, **fields)


def _bodies(like: dict[str, Any], table: dict[str, Any]) -> Bodies:
    fields: dict[str, Any] = {key: [*like.get(key, ()), *table.get(key, ())] for key in _fields(like | table)}
    return Bodies(**fields)


def _fields(table: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in table.items() if key not in ABOUT}


def directions(words: str) -> FloatArray:
    """Unit vectors along the axes of the base, from one word a joint, such as ``"z y -z"``. Shape (n, 3)."""
    return np.array([(-1.0 if word[0] == "-" else 1.0) * np.eye(3)["xyz".index(word[-1])] for word in words.split()])
