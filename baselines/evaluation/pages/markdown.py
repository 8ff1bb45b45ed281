"""What the pages have in common: tables of Markdown, their cells, and the conditions of a measurement."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable, Sequence

from baselines.evaluation.pages.measurement import Line, Measurement, Section
from baselines.evaluation.report import NOTHING

#: Where the plots lie, seen from the page.
IMAGES = pathlib.PurePath("images")
_TIMES = (
    "Times are those of single calls on one thread, with nothing else under way: garbage collection off, one call "
    "before that."
)


def table(head: Sequence[str], lines: Iterable[Sequence[str]], *, text: Sequence[int] = ()) -> list[str]:
    """A table of numbers, but for some columns, which are set to the left.

    Args:
        head: The names of the columns.
        lines: The cells.
        text: The numbers of the columns that hold text.
    """
    rules = [":--" if column in text else "--:" for column in range(len(head))]
    return [f"| {' | '.join(line)} |" for line in (head, rules, *lines)]


def collapsed(summary: str, lines: Sequence[str]) -> list[str]:
    """Lines that are shown when the reader asks for them."""
    return ["<details>", f"<summary>{summary}</summary>", "", *lines, "", "</details>", ""]


def share(value: float | None) -> str:
    """A share as a cell."""
    return NOTHING if value is None else f"{100.0 * value:.0f} %"


def time(microseconds: float | None) -> str:
    """A time as a cell."""
    return NOTHING if microseconds is None else f"{microseconds:,.0f}"


def runs(line: Line, section: Section) -> str:
    """Seeds × episodes as a cell."""
    return f"{max(len(line.seeds), 1)} × {len(section.seeds)}"


def episodes(section: Section) -> str:
    """How many episodes there are, and of which test set."""
    count = len(section.seeds)
    many = f"{count} episode{'s' * (count > 1)}"
    return f"{many}, test set {section.test_set}" if section.test_set else many


def conditions(measurement: Measurement) -> list[str]:
    """The last part of a page: what was measured how."""
    machine = ", ".join(f"{name} {value}" for name, value in measurement.machine.items())
    out = ["## Conditions", "", f"- command: `{measurement.command}`", f"- date: {measurement.date}"]
    out += [f"- machine: {machine}"]
    out += [f"- `{one.name}`: fingerprint {one.fingerprint}, {episodes(one)}" for one in measurement.sections]
    return [*out, f"- {_TIMES}"]
