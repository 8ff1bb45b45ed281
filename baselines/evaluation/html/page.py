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

import pandas as pd

from baselines.evaluation import report
from baselines.evaluation.columns import REPORT, columns
from baselines.evaluation.html.series import BUDGET, thin
from baselines.evaluation.metrics import Skipped
from baselines.evaluation.results import Results
from baselines.evaluation.summary import escape_names
from baselines.evaluation.table import html
from ikgym.exceptions import printable

#: A placeholder in the template.
PLACE = re.compile(r"\[\[(\w+)\]\]")


def page(
    results: Results, lines: pd.DataFrame, skipped: Sequence[Skipped] = (), *, command: str, date: datetime.datetime
) -> bytes:
    """The report of a folder of results, whose rows are summarised in lines."""
    from plotly.offline import get_plotlyjs  # slow to import, and not needed for rows

    series, lines = _series(results, lines), escape_names(lines)
    scenarios = lines.scenario.unique().tolist()
    numbers = {"scenarios": len(scenarios), "policies": lines.label.nunique(), "episodes": lines.rows.sum()}
    parts = {
        "style": _file("page.css"),
        "title": escape(", ".join(scenarios[:2]) + " …" * (len(scenarios) > 2)),
        "scenarios": escape(", ".join(scenarios)),
        "subtitle": f"{', '.join(f'{name}: {n}' for name, n in numbers.items())}; {date:%Y-%m-%d %H:%M} UTC",
        "table": html(columns(REPORT, lines), lines),
        "notes": _items(report.remarks(lines, skipped)),
        "conditions": _items([f"command: {command}", *report.machines(lines)]),
        "parameters": _items(report.parameters(lines)),
        "data": embed(data(lines, series)),
        "datatables": _file("datatables.min.js"),
        "plotly": get_plotlyjs(),
        "script": _file("page.js"),
    }
    return PLACE.sub(lambda found: parts[found[1]], _file("template.html")).encode()


def data(lines: pd.DataFrame, series: Sequence[dict[str, Any] | None]) -> list[dict[str, Any]]:
    """The data of the plots: costs, times and the thin trajectory log of each line of the table."""
    return [
        {
            **{"scenario": line.scenario, "policy": line.label, "reference": line.reference, "quantity": line.quantity},
            **{"low": _finite(line.low), "high": _finite(line.high), "value": _finite(line.mean)},
            **{"time": _finite(line.time_p50_us), "seed": line.first_seed, "series": log},
        }
        for line, log in zip(lines.itertuples(), series, strict=True)
    ]


def _series(results: Results, lines: pd.DataFrame) -> list[dict[str, Any] | None]:
    """The thin trajectory log of each line; None where there is none."""
    logged = [results.series_file(line).exists() for line in lines.itertuples()]
    return [
        thin(results.series(line), BUDGET // sum(logged)) if there else None
        for line, there in zip(lines.itertuples(), logged, strict=True)
    ]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def embed(content: Any) -> str:
    """JSON within a page: no text in it ends the element that it is in."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _file(name: str) -> str:
    return importlib.resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _items(texts: Iterable[str]) -> str:
    return "".join(f"<li>{escape(printable(text))}</li>" for text in texts)
