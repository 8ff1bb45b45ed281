"""Writes the tables of the documentation that follow from the code or from CSV files: ``python -m docs.tables``.

A test fails if a table in a page differs.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import shlex
from collections.abc import Iterable
from pathlib import Path

import numpy as np

import baselines
import ikgym
from baselines.cli.commands.arms import kinds_of_limits
from baselines.cli.commands.policies import summary
from baselines.evaluation import test_sets as sets
from baselines.evaluation.records import from_csv
from baselines.evaluation.records import markdown as results_table
from baselines.evaluation.table import NOTHING
from baselines.oracle import best_known
from baselines.oracle.best_known import MARGIN
from baselines.registry import get
from baselines.status import Status
from docs import loop
from docs.paper_pages import claims

PAGES = Path(__file__).parent


def arms() -> list[tuple[str, ...]]:
    """One line per arm."""
    rows = [("arm", "joints", "prismatic", "limits")]
    for name in ikgym.arms.names():
        arm = ikgym.arms.get(name)
        limits = ", ".join(kinds_of_limits(arm)) or "none"
        rows.append((f"`{name}`", str(arm.joints), str(sum(arm.prismatic)), limits))
    return rows


def tasks() -> list[tuple[str, ...]]:
    """One line per task."""
    return [("task", "coordinates", "components of the error", "orientation")] + [
        (f"`{task.name}`", str(task.size), str(task.error_size), "yes" if task.has_orientation else "no")
        for task in map(ikgym.tasks.get, ikgym.tasks.names())
    ]


def scenarios() -> list[tuple[str, ...]]:
    """One line per scenario; the paths that several arms have are in :func:`paths`."""
    rows = [("scenario", "arm", "task", "Δt [s]", "steps", "source")]
    for name in ikgym.scenarios.names():
        s = ikgym.scenarios.get(name)
        if name not in ikgym.scenarios.names("paths") or s.random:
            arm = f"`{s.arm.name}`" if s.model is s.arm else f"`{s.arm.name}`, model `{s.model.name}`"
            source = re.sub(r"(random motion|plant|path) of this project", "", s.source).strip(", ")
            rows.append((f"`{name}`", arm, f"`{s.task.name}`", f"{s.dt:g}", f"{s.steps:,}", source))
    return rows


def paths() -> list[tuple[str, ...]]:
    """One line per path, with the durations of its scenarios."""
    found: dict[str, dict[str, str]] = {}
    for s in map(ikgym.scenarios.get, ikgym.scenarios.names("paths")):
        if not s.random:
            found.setdefault(s.name.split("-")[1], {})[s.arm.name] = f"{s.steps * s.dt:.1f}"
    arms_of = tuple(next(iter(found.values())))
    return [("path", *(f"`{arm}` [s]" for arm in arms_of))] + [
        (f"`{path}`", *(times[arm] for arm in arms_of)) for path, times in found.items()
    ]


def problems() -> list[tuple[str, ...]]:
    """One line per problem from elsewhere."""
    rows = [("scenario", "arm", "waypoints", "starts", "longest [mm]", "largest [°]")]
    for name in ikgym.scenarios.problems_from_elsewhere():
        scenario = ikgym.scenarios.get(name)
        members = ikgym.problems.names(f"{name}-") if scenario.random else (name,)
        found = [ikgym.problems.waypoints(member) for member in members]
        counts = sorted({len(one.positions) for one in found})
        longest = max(np.linalg.norm(np.diff(one.positions, axis=0), axis=1).max() for one in found)
        cosines = min(np.abs((one.quaternions[1:] * one.quaternions[:-1]).sum(axis=1)).min() for one in found)
        cells = ["–".join(f"{counts[i]}" for i in sorted({0, len(counts) - 1})), str(len(found[0].starts) or NOTHING)]
        turn = np.degrees(2.0 * np.arccos(min(cosines, 1.0)))
        rows.append((f"`{name}`", f"`{scenario.arm.name}`", *cells, f"{1e3 * longest:.1f}", f"{turn:.1f}"))
    return rows


def splits() -> list[tuple[str, ...]]:
    """One line per split."""
    seeds = {name: f"{one.start:,} … {one.stop - 1:,}" for name, one in ikgym.scenarios.SPLITS.items()}
    return [("split", "seeds"), *seeds.items()]


def policies() -> list[tuple[str, ...]]:
    """One line per policy."""
    rows = [("policy", "what it does", "parameters and defaults")]
    for name in baselines.names():
        policy = get(name)
        parameters = [_parameter(policy.__dataclass_fields__[p]) for p in policy.parameter_names()]
        if base := next((other for other in baselines.names() if get(other) in policy.__mro__[1:]), None):
            shared = {_parameter(get(base).__dataclass_fields__[p]) for p in get(base).parameter_names()}
            parameters = [f"those of `{base}`", *(one for one in parameters if one not in shared)]
        rows.append((f"`{name}`" + (" (reference)" if policy.reference else ""), summary(name), ", ".join(parameters)))
    return rows


def test_sets() -> list[tuple[str, ...]]:
    """One line per test set."""
    rows: list[tuple[str, ...]] = [("set", "episodes", "noise seeds", "steps", "task coordinates")]
    for one in map(sets.get, sets.names()):
        scenario = one.scenario
        which = f"{one.episodes}"
        which += f", {one.sequence} in a row by one arm" if one.sequence > 1 else ""
        rows.append((f"`{one.name}`", which, str(one.noise_seeds), f"{scenario.steps:,}", f"`{scenario.task.name}`"))
    return rows


def records() -> list[tuple[str, ...]]:
    """One line per test set whose best known costs were searched."""
    several, alone = "two or more kinds of starts came to it", "random starts or local search alone did"
    head = ("set", "starts: least, median, most", several, alone, "which gained", "largest gradient [s/rad]")
    known = {one.scenario for one in best_known.read() if "starts" in one.spread}
    return [head, *(_records(name) for name in sets.names() if name in known)]


def _records(name: str) -> tuple[str, ...]:
    found = [one for one in best_known.read() if one.scenario == name]
    several = sum(";" in one.found_by for one in found)
    known = [(one.cost, one.spread["without_search"]) for one in found if "without_search" in one.spread]
    gains = [100.0 * (1.0 - cost / without) for cost, without in known if cost < without * (1.0 - MARGIN)]
    starts = [int(one.spread["starts"]) for one in found]
    return (
        f"`{name}`",
        f"{min(starts)}, {np.median(starts):.0f}, {max(starts)}",
        f"{several} of {len(found)}",
        f"{len(gains)} of {len(known)}" if known else NOTHING,
        f"{np.median(gains):.2g} % in the median, {max(gains):.2g} % at most" if gains else NOTHING,
        f"{max(one.gradient_norm for one in found):.1e}",
    )


def _parameter(field: dataclasses.Field[object]) -> str:
    """A parameter with its default; one without has None, and chooses for itself."""
    default = field.default
    if field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    return f"`{field.name}`" if default is None else f"`{field.name} = {default!r}`"


def statuses() -> list[tuple[str, ...]]:
    """One line per status, from good to bad."""
    source = inspect.getsource(Status)
    rows = [("status", "meaning")]
    for status in Status:
        comment = re.search(rf"((?:    #: .*\n|    #  .*\n)+)    {status.name} =", source)
        meaning = " ".join(line.strip(" #:") for line in comment[1].splitlines()) if comment else ""
        rows.append((f"`{status.label}`", meaning))
    return rows


_FROM_CODE = (arms, tasks, scenarios, paths, problems, splits, policies, statuses, test_sets, records)
TABLES = {**{make.__name__: make for make in _FROM_CODE}, "loop": loop.table}


def markdown(rows: Iterable[tuple[str, ...]]) -> str:
    """A table, its first row the head."""
    head, *body = rows
    lines = ["| " + " | ".join(row) + " |" for row in (head, *body)]
    return "\n".join([lines[0], "|---" * len(head) + "|", *lines[1:]])


def measured(file: str, *words: str) -> str:
    """The table of a CSV file: `columns=NAME,NAME,…` chooses columns, `NAME=VALUE` lines with that value there."""
    wanted = dict(word.split("=", 1) for word in words)
    columns = wanted.pop("columns", "").split(",")
    lines = from_csv((PAGES / file).read_text(encoding="utf-8"))
    lines = [line for line in lines if all(line[name] == value for name, value in wanted.items())]
    return results_table(lines, [name for name in columns if name])


def table(words: str) -> str:
    """The table, or the text, of what stands behind `<!-- table:`."""
    name, *rest = shlex.split(words)
    if name.endswith(".csv"):
        return measured(name, *rest)
    return claims() if name == "claims" else markdown(TABLES[name]())


def filled(text: str) -> str:
    """A page with its tables and texts updated."""
    place = re.compile(r"(<!-- table: (.+?) -->\n).*?(<!-- end -->)", re.DOTALL)
    return place.sub(lambda m: f"{m[1]}{table(m[2])}\n{m[3]}", text)


def main() -> None:
    """Writes the tables into the pages."""
    for page in sorted(PAGES.rglob("*.md")):
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
