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

from baselines.evaluation import report
from baselines.evaluation.html.series import BUDGET, thinned
from baselines.evaluation.jobs import Skipped
from baselines.evaluation.results import Results
from baselines.evaluation.summary import RATIO, Record, by_scenario
from baselines.evaluation.table import NOTHING, Column, html, number

#: A placeholder in the template.
PLACE = re.compile(r"\[\[(\w+)\]\]")


COLUMNS = (
    report.RATIO,
    Column(
        *("95 %", "", "low", "interval of the mean cost ratio over the episodes"),
        text=lambda line: report.interval(line) if line["quantity"] == RATIO else NOTHING,
    ),
    Column(
        *("worst", "", "worst", "largest cost ratio of an episode"),
        text=lambda line: number(line["worst"] if line["quantity"] == RATIO else None),
    ),
    report.TOTAL,
    *report.ERRORS,
    Column("at stop", "", "steps_at_joint_limit", "steps with a joint at a stop"),
    Column("at q̇ limit", "", "steps_at_velocity_limit", "steps with a joint at its velocity limit"),
    Column("at q̈ limit", "", "steps_at_acceleration_limit", "steps with a joint at its acceleration limit"),
    *(*report.PATH, *report.CONTACTS, *report.TIMES, report.EPISODES, report.LOST, report.FOLLOWED, report.STATUS),
)


def page(results: Results, skipped: Sequence[Skipped] = (), *, command: str, date: datetime.datetime) -> bytes:
    """The report of a folder of results."""
    from plotly.offline import get_plotlyjs  # slow to import, and not needed for rows

    rows = results.rows
    shown = [line for lines in by_scenario(rows).values() for line in lines]
    scenarios = list(dict.fromkeys(line["scenario"] for line in shown))
    numbers = {"scenarios": len(scenarios), "policies": len({one["policy"] for one in shown}), "episodes": len(rows)}
    parts = {
        "style": _file("page.css"),
        "title": escape(", ".join(scenarios[:2]) + " …" * (len(scenarios) > 2)),
        "scenarios": escape(", ".join(scenarios)),
        "subtitle": f"{', '.join(f'{name}: {n}' for name, n in numbers.items())}; {date:%Y-%m-%d %H:%M} UTC",
        "table": html(COLUMNS, shown),
        "notes": _items(report.remarks(rows, skipped)),
        "conditions": _items([f"command: {command}", *report.machines(rows)]),
        "parameters": _items(report.parameters(shown)),
        "data": embedded(data(results, shown)),
        "datatables": _file("datatables.min.js"),
        "plotly": get_plotlyjs(),
        "script": _file("page.js"),
    }
    return PLACE.sub(lambda found: parts[found[1]], _file("template.html")).encode()


def data(results: Results, lines: Sequence[Record]) -> list[dict[str, Any]]:
    """The data of the plots: costs, times and the thinned trajectory log of each line of the table."""
    logged = [line for line in lines if results.series_file(line["first"]).exists()]
    return [
        {
            **{name: line[name] for name in ("scenario", "policy", "reference", "quantity", "low", "high")},
            "value": line["mean"] if math.isfinite(line["mean"]) else None,
            "time": line["time_p50_us"],
            "seed": line["first"].seed,
            "series": thinned(results.series(line["first"]), BUDGET // len(logged)) if line in logged else None,
        }
        for line in lines
    ]


def embedded(content: Any) -> str:
    """JSON within a page: no text in it ends the element that it is in."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _file(name: str) -> str:
    return importlib.resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _items(texts: Iterable[str]) -> str:
    return "".join(f"<li>{escape(text)}</li>" for text in texts)
