"""The page: a template, the tables, the data, Plotly and the scripts, in one file."""

from __future__ import annotations

import datetime
import importlib.resources
import re
from collections.abc import Iterable, Sequence
from html import escape

from baselines.canonical import canonical
from baselines.evaluation.html.data import data, embedded
from baselines.evaluation.html.entries import Entry, entries
from baselines.evaluation.html.table import table
from baselines.evaluation.metrics import Row
from baselines.evaluation.plan import Skipped
from baselines.evaluation.report import NOTHING, machine_in_words, remarks
from baselines.evaluation.results import Results

#: The file in a folder of results.
PAGE = "report.html"
#: In the order in which they are run: later ones use earlier ones.
SCRIPTS = ("data.js", "table.js", "plots.js", "joints.js", "scene.js", "replay.js", "main.js")
#: Where a part of the page goes in the template.
PLACE = re.compile(r"\[\[(\w+)\]\]")


def page(results: Results, skipped: Sequence[Skipped] = (), *, command: str, date: datetime.datetime) -> bytes:
    """The report of a folder of results.

    Args:
        results: The folder.
        skipped: What was left out.
        command: What made them.
        date: When.

    Raises:
        ResultsError: A trajectory log is damaged.
    """
    from plotly.offline import get_plotlyjs  # not for those who only want rows

    rows = results.rows
    shown = entries(rows)
    said = [*remarks(rows), *(f"skipped: {one.policy} in {one.scenario}: {one.reason}" for one in skipped)]
    parts = {
        "style": _file("page.css"),
        "title": escape(", ".join(dict.fromkeys(one.scenario for one in shown))),
        "subtitle": f"{_count(rows, shown)}, finished {date:%Y-%m-%d %H:%M} UTC",
        "table": table(shown),
        "notes": _items(said),
        "conditions": _items([f"command: {command}", *_machines(rows)]),
        "parameters": _items(f"{one.policy} in {one.scenario}: {_parameters(one)}" for one in shown),
        "data": embedded(data(results, shown)),
        "plotly": get_plotlyjs(),
        "scripts": "\n".join(map(_file, SCRIPTS)),
    }
    return PLACE.sub(lambda found: parts[found[1]], _file("template.html")).encode()


def _file(name: str) -> str:
    return importlib.resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _items(texts: Iterable[str]) -> str:
    return "".join(f"<li>{escape(text)}</li>" for text in texts)


def _count(rows: Sequence[Row], shown: Sequence[Entry]) -> str:
    """How much there is, in words."""
    numbers = {
        "scenario": len({one.scenario for one in shown}),
        "policy": len({one.policy for one in shown}),
        "episode": len(rows),
    }
    plural = {"policy": "policies"}
    return ", ".join(f"{n} {name if n == 1 else plural.get(name, name + 's')}" for name, n in numbers.items())


def _machines(rows: Sequence[Row]) -> list[str]:
    different = list({canonical(row.machine): row.machine for row in rows}.values())
    warning = ["The rows were measured on different machines: their times cannot be compared."]
    return [f"machine: {machine_in_words(one)}" for one in different] + warning * (len(different) > 1)


def _parameters(entry: Entry) -> str:
    return ", ".join(f"{name}={value}" for name, value in entry.summary.parameters.items()) or NOTHING
