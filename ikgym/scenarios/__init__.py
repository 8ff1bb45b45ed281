"""Scenarios: tracking problems as data, by name.

>>> import ikgym
>>> ikgym.scenarios.get("varga7-fast").steps
3000

The scenarios of this package are the TOML files in the folder ``catalogue``. A user's scenario is such a file, or is
made in Python; :func:`find` takes all the ways to name one.
"""

from __future__ import annotations

import functools
import os
import pathlib
from collections.abc import Callable

import numpy as np

from ikgym import arms, problems
from ikgym.exceptions import InvalidInputError
from ikgym.files import read_user_toml
from ikgym.obstacles import Box
from ikgym.plant import Plant
from ikgym.plant.identified import IdentifiedPlant
from ikgym.registry import Registry, import_object
from ikgym.scenarios import files
from ikgym.scenarios.preview import Preview
from ikgym.scenarios.reachability import Gap, gaps
from ikgym.scenarios.scenario import Scenario, duration
from ikgym.trajectories import PublishedPath
from ikgym.trajectories.orientations import matrices
from ikgym.validation import add_location, known_name, shorten, whole_number

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

#: Reset seeds of the random scenarios, by purpose. Scores are published on the test seeds, counted from their first;
#: nothing may be trained or tuned on them, nor on those for validation.
SPLITS = {"train": range(0, 1_000_000), "validation": range(1_000_000, 2_000_000), "test": range(2_000_000, 3_000_000)}
#: The files of the catalogue: of the papers, paths for several arms, imperfect plants, arms that can touch something,
#: problems of others, and those of the environments for learning.
FILES = {
    family: sorted((pathlib.Path(__file__).parent / "catalogue" / family).glob("*.toml"), key=lambda file: file.stem)
    for family in ("papers", "paths", "plants", "bodies", "published", "learning")
}
#: Scenarios of the problems of others that have no file differ from these in their problem alone, by the beginning of
#: the name; from waypoint to waypoint they take a period, in [s].
LIKE = {"rlitg": "rlitg-hello", "cppflow-fetch": "cppflow-fetch-hello", "cppflow-panda": "cppflow-panda-square"}
PERIOD = 0.2


def load(file: str | os.PathLike[str]) -> Scenario:
    """The scenario of a file.

    Args:
        file: A TOML file, as :meth:`Scenario.save` writes it. Paths of other files in it are relative to it. With the
            key `like`, the name of another scenario, all missing keys are those of that scenario. The key `plant` is a
            table, or the name of a file that ``ikgym identify`` wrote.

    Returns:
        The scenario, checked like one that is made in Python.

    Raises:
        InvalidInputError: The file cannot be read, lacks a key, or a value is of a wrong type, length or range; the
            message names file and key.
        UnknownNameError: There is no such key, arm, task or kind of trajectory; the message has the nearest one.
        MissingDependencyError: An arm comes from a URDF file, and Pinocchio is not installed.
    """
    table, plant = read_user_toml(file), None
    if isinstance(table.get("plant"), str):  # identified, see :mod:`ikgym.plant.identified`
        plant = IdentifiedPlant.load(pathlib.Path(file).parent / table.pop("plant"))
    with add_location("", file):
        base = get(table.pop("like")) if "like" in table else None
        fields = files.arguments(Scenario, table, pathlib.Path(file).parent, like=base is not None)
        if base is not None and "trajectory" in fields and duration(fields["trajectory"]) is not None:
            fields.setdefault("steps", None)  # those of the new path
        if base is not None and plant is not None:
            fields["plant"] = Plant()  # in place of one that belongs to another Δt or arm
        scenario = Scenario(**fields) if base is None else base.replace(**fields)
        return scenario if plant is None else scenario.replace(plant=plant.plant_for(scenario.arm, scenario.dt))


_registry: Registry[Scenario] = Registry("scenario", Scenario)


def get(name: str) -> Scenario:
    """The scenario of a name.

    Raises:
        UnknownNameError: There is no such scenario; the message has the nearest name.
        InvalidInputError: The registered function fails, or does not return a scenario.
    """
    return _registry.get(name)


def names(family: str | None = None) -> tuple[str, ...]:
    """The names of all scenarios but those of learning and :func:`problems_from_elsewhere`, which "all" leaves out.

    Args:
        family: Only those of a folder of the catalogue: ``papers``, ``paths``, ``plants``, ``bodies``,
            ``published`` or ``learning``.

    Raises:
        UnknownNameError: There is no such folder.
    """
    if family is None:
        return _registry.names()
    known_name("family of scenarios", family, FILES)
    return tuple(file.stem for file in FILES[family])


def problems_from_elsewhere() -> tuple[str, ...]:
    """The scenarios that others published; each of the hundred paths of ``rlitg-random`` has a name."""
    return names("published")


def register(scenario: Scenario | str, make: Callable[[], Scenario] | None = None) -> None:
    """Adds a scenario.

    Args:
        scenario: The scenario, registered under its name; or a name, with a function that returns the scenario.
        make: Called without arguments when the scenario is first needed.

    Raises:
        InvalidInputError: The name is taken or no text, or `make` cannot be called.
    """
    if not isinstance(scenario, Scenario):
        _registry.register(scenario, make)  # type: ignore[arg-type]  # checked there
    elif make is None:
        _registry.register(scenario.name, lambda: scenario)
    else:
        raise InvalidInputError(f"make: expected none with the scenario {scenario.name!r}, got {make!r}.")


def find(item: Scenario | str | os.PathLike[str]) -> Scenario:
    """A scenario, however it is named.

    Args:
        item: A scenario; a registered name; a file that ends in ``.toml``; or ``"package.module:attribute"``, where
            the attribute is a scenario or a function that returns one. Registered names take precedence.

    Raises:
        UnknownNameError: There is no scenario of that name; the message has the nearest one.
        InvalidInputError: The file or the module does not give a scenario, or the item is none of these.
        MissingDependencyError: The file names a URDF file, and Pinocchio is not installed.
    """
    if isinstance(item, Scenario):
        return item
    if isinstance(item, os.PathLike):
        return load(item)
    if not isinstance(item, str):
        raise InvalidInputError(
            "scenario: expected a Scenario, its name, a file ending in .toml or 'package.module:attribute', got "
            f"{shorten(item)}."
        )
    if item not in _registry:
        if item.endswith(".toml"):
            return load(item)
        if ":" in item:
            found = import_object("scenario", item)
            return _registry.call_maker(item, found if callable(found) else lambda: found)
    return get(item)


def seeds(split: str, episodes: int) -> tuple[int, ...]:
    """The first seeds of a split.

    Args:
        split: One of the names in :data:`SPLITS`.
        episodes: Number of seeds.

    Raises:
        UnknownNameError: There is no such split.
        InvalidInputError: The split has fewer seeds, or the number is below 1.
    """
    known_name("split", split, SPLITS)
    available = SPLITS[split]
    if whole_number("episodes", episodes, at_least=1) > len(available):
        raise InvalidInputError(f"episodes: expected at most {len(available)} in split {split!r}, got {episodes}.")
    return tuple(available[:episodes])


def _make_published(problem: str) -> Scenario:
    """The scenario of a problem that has no file; a collision with its obstacles stops the arm.

    Bodies are those of our arms, and not the publishers'. Among obstacles the Panda has its hand.
    """
    like = next(get(name) for beginning, name in LIKE.items() if problem.startswith(beginning))
    arm = like.arm
    if arm.name == "panda":
        arm = arms.get("panda-hand").replace(tool=arm.tool, acceleration_limit=arm.acceleration_limit)
    published = problems.get(problem)
    rows = published.boxes
    zeros = np.zeros((2, len(rows)))
    turned = matrices(np.column_stack([np.cos(0.5 * rows[:, 6]), *zeros, np.sin(0.5 * rows[:, 6])]))
    return like.replace(
        name=problem,
        arm=arm,
        trajectory=PublishedPath(problem, PERIOD),
        steps=round(PERIOD / like.dt) * (len(published.positions) - 1),
        start=None,
        obstacles=[Box(f"box {i + 1}", row[:3], row[3:6], turned[i]) for i, row in enumerate(rows)],
    )


for _family, _files in FILES.items():
    for _file in _files:
        _registry.register(_file.stem, functools.partial(load, _file), listed=_family not in ("published", "learning"))
for _name in (*problems.OBSTRUCTED, *problems.names("rlitg-random-")):
    _registry.register(_name, functools.partial(_make_published, _name), listed=False)
