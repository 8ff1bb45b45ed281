"""What the pages have in common: tables of Markdown, their cells, and the conditions of a measurement."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Iterable, Sequence

from baselines.evaluation.metrics import LOST_ORIENTATION, LOST_POSITION
from baselines.evaluation.pages.entries import COSTLY_HORIZON, COSTLY_KNOTS, FEWER
from baselines.evaluation.pages.measurement import Line, Measurement, Section
from baselines.evaluation.pages.statistics import geometric_interval
from baselines.evaluation.report import NOTHING, number
from ikgym.validation import FloatArray

#: Where the plots lie, seen from the page.
IMAGES = pathlib.PurePath("images")
# Who plays fewer episodes, and why.
_FEWER = (
    f"Receding horizons to the optimum over more than {COSTLY_HORIZON} steps, and those with more than {COSTLY_KNOTS} "
    "knots, would take longer than all others together: they play the "
    f"first {100.0 * FEWER:g} % of the episodes, which the number of their episodes says in bold."
)
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


def between(values: FloatArray, interval: Callable[[FloatArray], tuple[float, float]] = geometric_interval) -> str:
    """The interval of what several runs came to as a cell, that of the geometric mean if no other is given.

    Args:
        values: One row a seed, one column an episode. Shape (s, e).
        interval: Gives its lower and upper end.
    """
    low, high = interval(values)
    return f"{number(low)} … {number(high)}"


def lost(section: Section) -> str:
    """When an arm counts as lost there, in words."""
    far = f"more than {1e3 * LOST_POSITION:g} mm away from where it should have been"
    return f"{far}, or turned away by more than {LOST_ORIENTATION:g} rad," if section.oriented else far


def fewer_episodes(section: Section) -> list[str]:
    """Who has played fewer episodes there, and why; nothing where nobody has."""
    return [_FEWER, ""] if any(line.episodes < len(section.seeds) for line in section.lines) else []


def time(microseconds: float | None) -> str:
    """A time as a cell."""
    return NOTHING if microseconds is None else f"{microseconds:,.0f}"


def runs(line: Line, section: Section) -> str:
    """Seeds × episodes as a cell; in bold where they are fewer than the set has."""
    fewer = "**" * (line.episodes < len(section.seeds))
    return f"{fewer}{max(len(line.seeds), 1)} × {line.episodes}{fewer}"


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
    for one in measurement.renewals:
        names = ", ".join(f"`{label}`" for label in one.labels)
        out.append(f"- played later, on {one.date}: {names}, by `{one.command}`")
    return [*out, f"- {_TIMES}"]
