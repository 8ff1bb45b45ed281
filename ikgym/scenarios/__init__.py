"""Scenarios: tracking problems as data, by name.

>>> import ikgym
>>> ikgym.scenarios.get("varga7-fast").steps
3000

A scenario of your own is made in Python, or read from a file; see :func:`find` for all the ways to name one.
"""

from __future__ import annotations

import os
from collections.abc import Callable

from ikgym.exceptions import InvalidInputError
from ikgym.preview import Preview
from ikgym.registry import Registry
from ikgym.scenarios import catalogue, elsewhere, families, imperfect
from ikgym.scenarios.importing import imported
from ikgym.scenarios.reachability import Gap, gaps
from ikgym.scenarios.reading import load
from ikgym.scenarios.scenario import Scenario
from ikgym.validation import known_name, shortened, whole_number

__all__ = [
    "SPLITS",
    "Gap",
    "Preview",
    "Scenario",
    "find",
    "gaps",
    "get",
    "load",
    "names",
    "problems_from_elsewhere",
    "register",
    "seeds",
]

#: Reset seeds of the random scenarios, by what they are for. Scores are published on the test seeds, counted from
#: their first; nothing may be trained or tuned on them, nor on those for validation.
SPLITS = {
    "train": range(0, 1_000_000),
    "validation": range(1_000_000, 2_000_000),
    "test": range(2_000_000, 3_000_000),
}

_registry: Registry[Scenario] = Registry("scenario", Scenario)
for _scenarios in (catalogue.SCENARIOS, families.SCENARIOS, imperfect.SCENARIOS):
    for _name, _make in _scenarios.items():
        _registry.register(_name, _make)
for _name, _make in elsewhere.SCENARIOS.items():
    _registry.register(_name, _make, listed=False)


def get(name: str) -> Scenario:
    """The scenario of a name.

    Raises:
        UnknownNameError: There is no such scenario; the message has the nearest name.
        InvalidInputError: What makes it fails, or makes something else.
    """
    return _registry.get(name)


def names() -> tuple[str, ...]:
    """The names of all scenarios but :func:`problems_from_elsewhere`, which "all" does not stand for."""
    return _registry.names()


def problems_from_elsewhere() -> tuple[str, ...]:
    """The scenarios that others published; the hundred paths of ``rlitg-random`` have names of their own, too."""
    return elsewhere.names()


def register(scenario: Scenario | str, make: Callable[[], Scenario] | None = None) -> None:
    """Adds a scenario of your own.

    Args:
        scenario: The scenario, which is registered under its own name; or a name, with the function that makes it.
        make: Called without arguments when the scenario of that name is first asked for.

    Raises:
        InvalidInputError: The name is taken or no text, or there is nothing that makes the scenario.
    """
    if not isinstance(scenario, Scenario):
        _registry.register(scenario, make)  # type: ignore[arg-type]  # checked there
    elif make is None:
        _registry.register(scenario.name, lambda: scenario)
    else:
        raise InvalidInputError(f"make: expected none beside the scenario {scenario.name!r}, got {make!r}.")


def find(item: Scenario | str | os.PathLike[str]) -> Scenario:
    """A scenario, in whichever way it is named.

    Args:
        item: A scenario; a registered name; a file that ends in ``.toml``; or ``"package.module:attribute"``, where
            the attribute is a scenario or a function that makes one. Registered names take precedence.

    Raises:
        UnknownNameError: There is no scenario of that name; the message has the nearest one.
        InvalidInputError: The file or the module does not give a scenario, or the item is nothing of all this.
        MissingDependencyError: The file names a URDF file, and Pinocchio is not installed.
    """
    if isinstance(item, Scenario):
        return item
    if isinstance(item, os.PathLike):
        return load(item)
    if not isinstance(item, str):
        raise InvalidInputError(
            "scenario: expected a Scenario, a name of one, a file ending in .toml or 'package.module:attribute', got "
            f"{shortened(item)}."
        )
    if item not in _registry:
        if item.endswith(".toml"):
            return load(item)
        if ":" in item:
            return imported(item)
    return get(item)


def seeds(split: str, episodes: int) -> tuple[int, ...]:
    """The first seeds of a split.

    Args:
        split: One of the names in :data:`SPLITS`.
        episodes: How many seeds.

    Raises:
        UnknownNameError: There is no such split.
        InvalidInputError: The split has fewer seeds, or the number is below 1.
    """
    known_name("split", split, SPLITS)
    available = SPLITS[split]
    if whole_number("episodes", episodes, at_least=1) > len(available):
        raise InvalidInputError(f"episodes: expected at most {len(available)} in split {split!r}, got {episodes}.")
    return tuple(available[:episodes])
