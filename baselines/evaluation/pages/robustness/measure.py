"""Plays policies on test sets of imperfect plants, and over two severities of one of them."""

from __future__ import annotations

import dataclasses
import itertools
import pathlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from tqdm import tqdm

from baselines.episodes import Seeds
from baselines.evaluation.metrics import Row
from baselines.evaluation.pages import measure
from baselines.evaluation.pages.robustness.measured import Cell, Effect, Entry
from baselines.evaluation.plan import Job, make_plan
from baselines.evaluation.report import is_reference
from baselines.evaluation.results import slug
from baselines.evaluation.summary import summarise
from baselines.oracle import Search, best_known
from baselines.oracle.several import Wanted, find_all
from baselines.spec import parse_policy
from baselines.workers import ALONE, Workers
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.plant import Plant
from ikgym.scenarios import Scenario, imperfect

#: Severities of the map, from ideal to the worst.
SEVERITIES = (0.0, 0.25, 0.5, 0.75, 1.0)
#: The parts of a plant by what they are called, and the same with none of them.
EFFECTS = {
    "calibration": ("zero", "link", "axis", "arms"),
    "payload": ("payload", "payload_step"),
    "noise and gaps of the camera": ("pose_every", "pose_missing", "pose_noise", "pose_rotation_noise", "pose_delay"),
    "lag of the drives": ("bandwidth",),
    "delay of commands": ("command_delay",),
}
IDEAL = "ideal"
#: How thoroughly best known costs are searched where none is recorded: on these paths many starts find the same.
HOW = Search(starts=20, generations=0)


def places(severities: Iterable[float]) -> list[tuple[float, float]]:
    """Severities of knowledge and of drives, in the order of the map."""
    severities = tuple(severities)
    return list(itertools.product(severities, severities))


def at(name: str, place: tuple[float, float]) -> Scenario:
    """A scenario at a place of the map; 1 is the plant that it has, and the worst of `panda-field`.

    Args:
        name: Of the scenario, or of its file.
        place: Severities of knowledge and of drives.

    Raises:
        UnknownNameError: There is no such scenario.
        InvalidInputError: Its plant is ideal, or has arms of its own; a severity is below 0.
    """
    base = scenarios.find(name)
    if base.plant.ideal:
        raise InvalidInputError(f"Scenario {base.name!r}: expected a plant that is not ideal.")
    here = imperfect.field(*place) if name == imperfect.FIELD_NAME else base.replace(plant=base.plant.scaled(*place))
    return here.replace(name=f"{base.name} {place[0]:g} {place[1]:g}")


def effects_of(plant: Plant) -> dict[str, Plant]:
    """The parts of a plant, each with all else ideal; those that it does not have are left out."""
    on = plant.switched_on()
    parts = {name: {field: on[field] for field in fields if field in on} for name, fields in EFFECTS.items()}
    return {name: Plant(**part) for name, part in parts.items() if part}


def effects(
    name: str, policies: Mapping[str, str], folder: pathlib.Path, *, episodes: int, **options: Any
) -> tuple[Effect, ...]:
    """What the parts of a scenario's plant cost, each alone, beside the same episodes with an ideal plant.

    Args:
        name: Of the scenario.
        policies: What they are called, and what they are.
        folder: For the results.
        episodes: Of each policy with each effect.
        options: Of :func:`baselines.evaluation.pages.measure.play`.

    Raises:
        IkgymError: As in :func:`baselines.evaluation.pages.measure.play`.
    """
    base = scenarios.find(name)
    plants = {IDEAL: Plant(), **effects_of(base.plant)}
    alone = {what: base.replace(name=f"{base.name}, {what}", plant=plant) for what, plant in plants.items()}
    plans = {
        (label, what): _untimed(make_plan(scenario, policy, episodes=episodes).jobs)
        for label, policy in policies.items()
        for what, scenario in alone.items()
    }
    rows = measure.play(plans, folder / "effects", **options)
    return tuple(
        Effect.of(label, what, found, rows[label, IDEAL]) for (label, what), found in rows.items() if what != IDEAL
    )


def cells(
    name: str,
    policies: Mapping[str, str],
    folder: pathlib.Path,
    *,
    severities: Sequence[float],
    episodes: int,
    **options: Any,
) -> tuple[Cell, ...]:
    """The map.

    Args:
        name: Of the scenario.
        policies: What they are called, and what they are: names, with parameters or without.
        folder: For the results.
        severities: Of knowledge, and of drives.
        episodes: Of each policy in each cell.
        options: Of :func:`baselines.evaluation.pages.measure.play`.

    Raises:
        IkgymError: As in :func:`baselines.evaluation.pages.measure.play`.
    """
    everywhere = {place: at(name, place) for place in places(severities)}
    plans = {
        (label, place): _untimed(make_plan(scenario, policy, episodes=episodes).jobs)
        for label, policy in policies.items()
        for place, scenario in everywhere.items()
    }
    rows = measure.play(plans, folder / slug(name), **options)
    how = {"progress": bool(options.get("progress")), "workers": options.get("workers", ALONE)}
    seeds = {place: tuple(dict.fromkeys(job.seed for job in jobs)) for (_, place), jobs in plans.items()}
    bounds = _bounds(everywhere, seeds, **how)
    return tuple(Cell.of(policy, place, found, bounds[place]) for (policy, place), found in rows.items())


def entries(
    sets: Sequence[str],
    policies: Mapping[str, str],
    folder: pathlib.Path,
    *,
    episodes: int | None = None,
    whole: Collection[tuple[str, str]] = (),
    **options: Any,
) -> tuple[Entry, ...]:
    """Policies on test sets, each beside itself on an ideal plant.

    Args:
        sets: Names of test sets.
        policies: What they are called, and what they are: names, with parameters or without.
        folder: For the results.
        episodes: The first episodes of each set; all of them if left out.
        whole: Policies and sets that are played to their ends all the same.
        options: Of :func:`baselines.evaluation.pages.measure.play`.

    Raises:
        IkgymError: As in :func:`baselines.evaluation.pages.measure.play`.
    """
    plans = {
        label: _first(
            _untimed(make_plan((), policy, test_sets=sets, pairs=True).jobs),
            episodes,
            {name for one, name in whole if one == label},
        )
        for label, policy in policies.items()
    }
    played = measure.play(plans, folder / "sets", **options)
    return tuple(one for label, rows in played.items() for one in _of_policy(label, policies[label], sets, rows))


def _first(jobs: Sequence[Job], episodes: int | None, whole: Collection[str]) -> list[Job]:
    """The jobs of the first episodes, and all of whole sets and of the ideal episodes beside them."""
    if episodes is None:
        return list(jobs)
    first = scenarios.seeds("test", episodes)
    return [
        job
        for job in jobs
        if job.seed in first or job.scenario.name in whole or (whole and job.scenario.plant.ideal)
    ]  # fmt: skip


def _of_policy(label: str, policy: str, sets: Sequence[str], rows: Sequence[Row]) -> Iterator[Entry]:
    reference = is_reference(parse_policy(policy)[0])
    for summary in summarise(rows):
        if summary.scenario in sets:
            own = [row for row in rows if row.scenario == summary.scenario]
            yield Entry.of(label, summary, own, reference=reference)


def _bounds(
    everywhere: Mapping[tuple[float, float], Scenario],
    seeds: Mapping[tuple[float, float], Sequence[int]],
    *,
    progress: bool,
    workers: Workers,
) -> dict[tuple[float, float], dict[int, float]]:
    """The best known cost of each episode; what is not recorded is searched, and kept on disk."""
    out: dict[tuple[float, float], dict[int, float]] = {place: {} for place in everywhere}
    missing: dict[Wanted, tuple[float, float]] = {}
    for place, scenario, seed in ((*one, seed) for one in everywhere.items() for seed in seeds[one[0]]):
        if (cost := best_known.cost(scenario, seed)) is not None:
            out[place][seed] = cost
        else:
            missing[Wanted(scenario, Seeds(seed), HOW)] = place
    with tqdm(total=len(missing), disable=not progress, unit="best known cost") as bar:
        # One search takes all cores of this machine; a cluster gives each a core.
        for one, optimum in find_all(list(missing), workers if workers.cluster else ALONE):
            out[missing[one]][one.draw.seed] = optimum.cost
            bar.update()
    return out


def _untimed(jobs: Iterable[Job]) -> list[Job]:
    """Jobs without a clock, and without a trajectory log, which nobody draws."""
    return [dataclasses.replace(job, first=False, timed=False) for job in jobs]
