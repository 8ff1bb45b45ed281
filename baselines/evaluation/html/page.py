"""The page: template, table, data, DataTables, Plotly and the script that connects them, in one file."""

from __future__ import annotations

import datetime
import importlib.resources
import json
import math
import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from baselines.canonical import canonical
from baselines.evaluation.html.entries import Entry, entries
from baselines.evaluation.html.series import BUDGET, thinned
from baselines.evaluation.html.table import table
from baselines.evaluation.jobs import Skipped
from baselines.evaluation.metrics import Row
from baselines.evaluation.report import NOTHING, machine_in_words, remarks
from baselines.evaluation.results import Results

#: A placeholder in the template.
PLACE = re.compile(r"\[\[(\w+)\]\]")


def page(results: Results, skipped: Sequence[Skipped] = (), *, command: str, date: datetime.datetime) -> bytes:
    """The report of a folder of results.

    Args:
        results: The folder.
        skipped: Policies that were skipped.
        command: The command of the evaluation.
        date: When it finished.

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
        "datatables": _file("datatables.min.js"),
        "plotly": get_plotlyjs(),
        "script": _file("page.js"),
    }
    return PLACE.sub(lambda found: parts[found[1]], _file("template.html")).encode()


def data(results: Results, all_entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """The data of the plots: costs, times and the thinned trajectory log of each entry.

    Args:
        results: The folder.
        all_entries: The lines of the table.

    Raises:
        ResultsError: A trajectory log is damaged.
    """
    logged = [entry for entry in all_entries if results.series_file(entry.rows[0]).exists()]
    return [
        {
            "scenario": entry.scenario,
            "policy": entry.policy,
            "reference": entry.reference,
            "quantity": entry.quantity,
            "value": _finite((entry.summary.cost_ratio or entry.summary.total_cost).mean),
            "low": _finite(entry.interval[0]) if entry.interval else None,
            "high": _finite(entry.interval[1]) if entry.interval else None,
            "time": entry.summary.time_p50_us,
            "seed": entry.rows[0].seed,
            "series": thinned(results.series(entry.rows[0]), BUDGET // len(logged)) if entry in logged else None,
        }
        for entry in all_entries
    ]


def embedded(content: Any) -> str:
    """JSON within a page: no text in it ends the element that it is in."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _file(name: str) -> str:
    return importlib.resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _items(texts: Iterable[str]) -> str:
    return "".join(f"<li>{escape(text)}</li>" for text in texts)


def _count(rows: Sequence[Row], shown: Sequence[Entry]) -> str:
    """Numbers of scenarios, policies and episodes, in words."""
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
