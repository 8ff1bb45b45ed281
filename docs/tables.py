"""Writes the tables of the documentation that follow from the code or from CSV files: ``python -m docs.tables``.

A test fails if a table in a page differs.
"""

from __future__ import annotations

import inspect
import re
import shlex

import baselines
import ikgym
from baselines.cli.commands.policies import summary
from baselines.evaluation import test_sets as sets
from baselines.evaluation.table import grid, markdown
from baselines.registry import get
from baselines.status import Status
from docs.drives import predictions
from docs.keeping import PAGES, lines
from docs.paper_pages import claims


def tasks() -> list[tuple[str, ...]]:
    """One line per task."""
    return [("task", "coordinates", "components of the error", "orientation")] + [
        (f"`{task.name}`", str(task.size), str(task.error_size), "yes" if task.has_orientation else "no")
        for task in map(ikgym.tasks.get, ikgym.tasks.names())
    ]


def splits() -> list[tuple[str, ...]]:
    """One line per split."""
    seeds = {name: f"{one.start:,} … {one.stop - 1:,}" for name, one in ikgym.scenarios.SPLITS.items()}
    return [("split", "seeds"), *seeds.items()]


def policies() -> list[tuple[str, ...]]:
    """One line per policy."""
    return [("policy", "what it does")] + [
        (f"`{name}`" + " (reference)" * get(name).reference, summary(name)) for name in baselines.names()
    ]


def test_sets() -> list[tuple[str, ...]]:
    """One line per test set."""
    rows: list[tuple[str, ...]] = [("set", "episodes", "noise seeds", "steps")]
    for one in map(sets.get, sets.names()):
        scenario = one.scenario
        which = f"{one.episodes}"
        which += f", {one.sequence} in a row by one arm" if one.sequence > 1 else ""
        rows.append((f"`{one.name}`", which, str(one.noise_seeds), f"{scenario.steps:,}"))
    return rows


def statuses() -> list[tuple[str, ...]]:
    """One line per status, from good to bad."""
    source = inspect.getsource(Status)
    rows = [("status", "meaning")]
    for status in Status:
        comment = re.search(rf"((?:    #: .*\n|    #  .*\n)+)    {status.name} =", source)
        meaning = " ".join(line.strip(" #:") for line in comment[1].splitlines()) if comment else ""
        rows.append((f"`{status.label}`", meaning))
    return rows


TABLES = {make.__name__: make for make in (tasks, splits, policies, statuses, test_sets, predictions)}


def csv_table(name: str, *words: str) -> str:
    """The table of a CSV file.

    `columns=NAME,NAME` chooses columns, `NAME=VALUE|VALUE` lines with such a value. With `across=NAME cells=NAME` each
    value of a column becomes a column.
    """
    wanted = dict(word.split("=", 1) for word in words)
    columns = [column for column in wanted.pop("columns", "").split(",") if column]
    across, cells = wanted.pop("across", ""), wanted.pop("cells", "")
    kept = [line for line in lines(name) if all(line[key] in values.split("|") for key, values in wanted.items())]
    if across:
        rows: dict[tuple[str, ...], dict[str, str]] = {}
        for line in kept:
            rows.setdefault(tuple(line[column] for column in columns), dict(line))[line[across]] = line[cells]
        columns += dict.fromkeys(line[across] for line in kept)
        kept = [dict.fromkeys(columns) | row for row in rows.values()]
    return markdown(kept, columns)


def table(words: str) -> str:
    """The table, or the text, of the words after `<!-- table:`."""
    name, *rest = shlex.split(words)
    if name.startswith("results/"):
        return csv_table(name.removeprefix("results/").removesuffix(".csv"), *rest)
    if name == "claims":
        return claims()
    head, *body = TABLES[name]()
    return grid(head, body, text=range(len(head)))


def fill_in(text: str) -> str:
    """A page with its tables and texts updated."""
    place = re.compile(r"(<!-- table: (.+?) -->\n).*?(<!-- end -->)", re.DOTALL)
    return place.sub(lambda m: f"{m[1]}{table(m[2])}\n{m[3]}", text)


def main() -> None:
    """Writes the tables into the pages."""
    for page in sorted(PAGES.rglob("*.md")):
        page.write_text(fill_in(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
