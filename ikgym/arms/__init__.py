"""Arms: the frozen description of a serial chain, the arms of papers and of makers, and conversions from other forms.

>>> import ikgym
>>> ikgym.arms.get("varga7").joints
7
"""

from __future__ import annotations

import functools
import importlib
import os
import pathlib
import tomllib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.bodies import Bodies
from ikgym.registry import Registry
from ikgym.validation import FloatArray

if TYPE_CHECKING:
    from ikgym.arms.denavit_hartenberg import from_dh
    from ikgym.arms.urdf import Tip, from_urdf, tips

__all__ = ["SHIPPED", "Arm", "Bodies", "Tip", "from_dh", "from_urdf", "get", "names", "register", "tips"]

#: The arms of papers and of makers, with their sources.
CATALOGUE = pathlib.Path(__file__).with_name("arms.toml")
#: Keys of a table that are no fields of an arm, nor of its bodies.
ABOUT = ("source", "licence", "like")
# Conversions, imported when they are first used, and their modules.
_CONVERSIONS = {"from_dh": "denavit_hartenberg", "Tip": "urdf", "from_urdf": "urdf", "tips": "urdf"}


def __getattr__(name: str) -> Any:
    if name in _CONVERSIONS:
        return getattr(importlib.import_module(f"{__name__}.{_CONVERSIONS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def get(name: str) -> Arm:
    """The arm of a name.

    Raises:
        UnknownNameError: There is no such arm; the message has the nearest name.
        InvalidInputError: The registered function fails, or does not return an arm.
    """
    return _registry.get(name)


def names() -> tuple[str, ...]:
    """The names of all arms."""
    return _registry.names()


def register(name: str, make: Callable[[], Arm]) -> None:
    """Adds an arm.

    Args:
        name: Its new name.
        make: Returns the arm; called without arguments when the arm is first needed.

    Raises:
        InvalidInputError: The name is taken or no text, or `make` cannot be called.
    """
    _registry.register(name, make)


def read_catalogue(file: str | os.PathLike[str] = CATALOGUE) -> dict[str, Callable[[], Arm]]:
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


_registry: Registry[Arm] = Registry("arm", Arm)
for _name, _make in read_catalogue().items():
    _registry.register(_name, _make)
#: The arms of this package, which files may refer to by name.
SHIPPED = frozenset(_registry.names())
