"""The page: template, table, data, DataTables, Plotly and the script that connects them, in one file."""

from __future__ import annotations

import datetime
import functools
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
from baselines.evaluation.summary import Summary, by_scenario
from baselines.evaluation.table import NOTHING, Column, html

#: A placeholder in the template.
PLACE = re.compile(r"\[\[(\w+)\]\]")


COLUMNS = (
    report.RATIO,
    Column(
        "95 %",
        "",
        lambda s: s.interval[0] if s.cost_ratio and s.interval else None,
        text=lambda s: report.interval_text(s.interval if s.cost_ratio else None),
        about="interval of the mean cost ratio over the episodes",
    ),
    Column("worst", "", lambda s: s.cost_ratio and s.cost_ratio.worst, about="largest cost ratio of an episode"),
    report.TOTAL,
    *report.ERRORS,
    *(
        Column(f"at {limit}", "", functools.partial(Summary.total, column=f"steps_at_{kind}_limit"), about=about)
        for limit, kind, about in (
            ("stop", "joint", "steps with a joint at a stop"),
            ("q̇ limit", "velocity", "steps with a joint at its velocity limit"),
            ("q̈ limit", "acceleration", "steps with a joint at its acceleration limit"),
        )
    ),
    *report.PATH,
    *report.CONTACTS,
    *report.TIMES,
    report.EPISODES,
    report.LOST,
    report.FOLLOWED,
    report.STATUS,
)


def page(results: Results, skipped: Sequence[Skipped] = (), *, command: str, date: datetime.datetime) -> bytes:
    """The report of a folder of results."""
    from plotly.offline import get_plotlyjs  # slow to import, and not needed for rows

    rows = results.rows
    shown = [summary for some in by_scenario(rows).values() for summary in some]
    scenarios = list(dict.fromkeys(one.first.scenario for one in shown))
    numbers = {"scenarios": len(scenarios), "policies": len({one.label for one in shown}), "episodes": len(rows)}
    parts = {
        "style": _file("page.css"),
        "title": escape(", ".join(scenarios[:2]) + " …" * (len(scenarios) > 2)),
        "scenarios": escape(", ".join(scenarios)),
        "subtitle": f"{', '.join(f'{name}: {n}' for name, n in numbers.items())}; {date:%Y-%m-%d %H:%M} UTC",
        "table": html(COLUMNS, shown),
        "notes": _items(
            [*report.remarks(rows), *(f"skipped: {one.policy} in {one.scenario}: {one.reason}" for one in skipped)]
        ),
        "conditions": _items([f"command: {command}", *report.machines(rows)]),
        "parameters": _items(f"{one.label} in {one.first.scenario}: {_parameters(one)}" for one in shown),
        "data": embedded(data(results, shown)),
        "datatables": _file("datatables.min.js"),
        "plotly": get_plotlyjs(),
        "script": _file("page.js"),
    }
    return PLACE.sub(lambda found: parts[found[1]], _file("template.html")).encode()


def data(results: Results, summaries: Sequence[Summary]) -> list[dict[str, Any]]:
    """The data of the plots: costs, times and the thinned trajectory log of each line of the table."""
    logged = [one for one in summaries if results.series_file(one.first).exists()]
    return [
        {
            "scenario": one.first.scenario,
            "policy": one.label,
            "reference": one.reference,
            "quantity": "cost ratio" if one.cost_ratio else "total cost",
            "value": _finite((one.cost_ratio or one.total_cost).mean),
            "low": one.interval and _finite(one.interval[0]),
            "high": one.interval and _finite(one.interval[1]),
            "time": one.median("time_p50_us"),
            "seed": one.first.seed,
            "series": thinned(results.series(one.first), BUDGET // len(logged)) if one in logged else None,
        }
        for one in summaries
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


def _parameters(summary: Summary) -> str:
    return ", ".join(f"{name}={value}" for name, value in summary.first.parameters.items()) or NOTHING
