"""Scenarios: tracking problems as data, by name.

>>> import ikgym
>>> ikgym.scenarios.get("varga7-fast").steps
3000
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable

from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.registry import Registry
from ikgym.scenarios.catalogue import SCENARIOS
from ikgym.scenarios.scenario import Disturbance, Preview, Scenario
from ikgym.validation import whole_number

__all__ = ["SPLITS", "Disturbance", "Preview", "Scenario", "find", "get", "names", "register", "seeds"]

#: Reset seeds of the random scenarios, by what they are for. Scores are published on the test seeds, counted from
#: their first; nothing may be trained or tuned on them, nor on those for validation.
SPLITS = {
    "train": range(0, 1_000_000),
    "validation": range(1_000_000, 2_000_000),
    "test": range(2_000_000, 3_000_000),
}

_registry: Registry[Scenario] = Registry("scenario")
for _name, _make in SCENARIOS.items():
    _registry.register(_name, _make)


def get(name: str) -> Scenario:
    """The scenario of a name.

    Raises:
        UnknownNameError: There is no such scenario; the message has the nearest name.
    """
    scenario = _registry.get(name)
    if not isinstance(scenario, Scenario):
        raise InvalidInputError(f"Scenario {name!r}: its maker gave {scenario!r}, which is no Scenario.")
    return scenario


def find(item: str | Scenario) -> Scenario:
    """The scenario that is meant by a scenario, its name, or ``"package.module:attribute"``.

    Raises:
        UnknownNameError: There is no scenario of that name.
        InvalidInputError: The attribute cannot be imported, or is no scenario.
    """
    if isinstance(item, Scenario):
        return item
    if not isinstance(item, str) or ":" not in item:
        return get(item)
    module, _, attribute = item.partition(":")
    try:
        found = functools.reduce(getattr, attribute.split("."), importlib.import_module(module))
    except Exception as e:  # whatever the module of somebody else raises
        raise InvalidInputError(f"Scenario {item!r}: cannot be imported: {type(e).__name__}: {e}.") from e
    if not isinstance(found, Scenario):
        raise InvalidInputError(f"Scenario {item!r}: expected a Scenario, got {found!r}.")
    return found


def names() -> tuple[str, ...]:
    """The names of all scenarios."""
    return _registry.names()


def register(name: str, make: Callable[[], Scenario]) -> None:
    """Adds a scenario of your own.

    Args:
        name: Its new name.
        make: Called without arguments when the scenario is first asked for.

    Raises:
        InvalidInputError: The name is taken.
    """
    _registry.register(name, make)


def seeds(split: str, episodes: int) -> tuple[int, ...]:
    """The first seeds of a split.

    Args:
        split: One of the names in :data:`SPLITS`.
        episodes: How many seeds.

    Raises:
        UnknownNameError: There is no such split.
        InvalidInputError: The split has fewer seeds, or the number is below 1.
    """
    if split not in SPLITS:
        raise UnknownNameError("split", split, SPLITS)
    available = SPLITS[split]
    if whole_number("episodes", episodes, at_least=1) > len(available):
        raise InvalidInputError(f"episodes: expected at most {len(available)} in split {split!r}, got {episodes}.")
    return tuple(available[:episodes])
