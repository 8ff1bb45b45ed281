"""What the scripts of the page read: rows, summaries and series, as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from baselines.canonical import canonical
from baselines.evaluation.html.entries import Entry
from baselines.evaluation.html.series import BUDGET, thinned
from baselines.evaluation.metrics import Row
from baselines.evaluation.results import Results


def packed(rows: Sequence[Row]) -> dict[str, Any]:
    """Rows as columns. Of texts and objects each is there once, and the rows have its number: most rows share them."""
    table = [row.to_json() for row in rows]
    out: dict[str, Any] = {}
    for name in table[0] if table else ():
        cells = [row[name] for row in table]
        if not any(isinstance(cell, (str, dict)) for cell in cells):
            out[name] = cells
            continue
        distinct: dict[str, Any] = {}
        texts = [canonical(cell) for cell in cells]
        for text, cell in zip(texts, cells, strict=True):
            distinct.setdefault(text, cell)
        numbers = {text: number for number, text in enumerate(distinct)}
        out[name] = {"distinct": list(distinct.values()), "index": [numbers[text] for text in texts]}
    return out


def unpacked(columns: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rows, as results.json has them."""
    cells = [
        column if isinstance(column, list) else [column["distinct"][number] for number in column["index"]]
        for column in columns.values()
    ]
    return [dict(zip(columns, line, strict=True)) for line in zip(*cells, strict=True)]


def data(results: Results, entries: Sequence[Entry]) -> dict[str, Any]:
    """All that the scripts read.

    Args:
        results: The folder.
        entries: What its rows come to.

    Raises:
        ResultsError: A trajectory log is damaged.
    """
    logged = sum(results.series_file(one.rows[0]).exists() for one in entries)
    return {"rows": packed(results.rows), "entries": [_shown(results, one, logged) for one in entries]}


def _shown(results: Results, entry: Entry, logged: int) -> dict[str, Any]:
    """What the pictures show of an entry; one of so many that have a log."""
    first, summary = entry.rows[0], entry.summary
    there = results.series_file(first).exists()
    return {
        "scenario": entry.scenario,
        "policy": entry.policy,
        "reference": entry.reference,
        "quantity": entry.quantity,
        "value": _finite((summary.cost_ratio or summary.total_cost).mean),
        "low": _finite(entry.interval[0]) if entry.interval else None,
        "high": _finite(entry.interval[1]) if entry.interval else None,
        "time": summary.time_p50_us,
        "episodes": summary.episodes,
        "seed": first.seed,
        "series": thinned(results.series(first), BUDGET // logged) if there else None,
    }


def embedded(content: Any) -> str:
    """JSON that may stand in a page: no text in it ends the element that it is in."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
