"""Comparisons of policies as records: a record is a line of a table, kept in a CSV file and shown as Markdown.

Names of columns end with the unit (`time_p50_us`), and an interval is a pair of columns `low` and `high`, possibly with
a prefix.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from baselines import registry
from baselines.canonical import canonical, jsonable
from baselines.evaluation.metrics import Row
from baselines.evaluation.summary import Summary, by_seed, summarise
from baselines.evaluation.table import NOTHING, code, escaped, grid, number
from baselines.oracle import best_known
from baselines.spec import parse_policy
from baselines.statistics import geometric_interval, geometric_mean
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios.preview import furthest
from ikgym.validation import FloatArray

#: One line of a table: the name of each column and its value.
Record = Mapping[str, Any]
#: Cost ratios where best known costs are missing: relative to the lowest cost in the table.
LOWEST = "lowest in the table"
BEST_KNOWN = "best known"
#: Suffixes of columns and the units in the heads.
UNITS = {
    "us": "µs",
    "um": "µm",
    "ms": "ms",
    "s": "s",
    "mm": "mm",
    "mrad": "mrad",
    "rad": "rad",
    "deg": "°",
    "percent": "%",
}
#: Columns that are set as code.
CODE = ("policy", "scenario", "agent", "solver", "beside")


def records(rows: Sequence[Row], policies: Sequence[str] = ()) -> list[dict[str, Any]]:
    """One record per policy and scenario, sorted by cost ratio within each scenario.

    Agents whose files lie in ``DIR/seed-N/`` are training seeds of one agent, which is called DIR. Cost ratios are
    relative to best known costs; if one is missing, to the lowest cost in the table.

    Args:
        rows: Results of an evaluation.
        policies: The policies that were evaluated, as text; each is the label of its line. Others are called by their
            name and the parameters that are not at their defaults.

    Where a policy has free timing, there are two more columns: the time in which it reached the end of the path, and
    the largest distance from the reference at the policy's own progress, or on the clock of the others. Where a
    scenario has collisions, there are the share of episodes in which the arm was stopped and the smallest clearance.

    Raises:
        InvalidInputError: The training seeds of an agent have played different episodes.
    """
    out: list[dict[str, Any]] = []
    timing = any(row.path_position_error is not None for row in rows)
    colliding = any(row.clearance_min is not None for row in rows)
    for scenario in dict.fromkeys(row.scenario for row in rows):
        here = [row for row in rows if row.scenario == scenario]
        known = all(row.cost_ratio is not None for row in here)
        lowest = {} if known else _lowest(here)
        labelled = _by_label(here, policies).items()
        found = [
            _record(label, some, lowest)
            | (_along_path(some) if timing else {})
            | (_contacts(some) if colliding else {})
            for label, some in labelled
        ]
        out += sorted(found, key=lambda one: one["cost_ratio"])
    return out


def _by_label(rows: Sequence[Row], policies: Sequence[str]) -> dict[str, list[Row]]:
    """The rows of one scenario by the label of their policy."""
    given = {text: parse_policy(text) for text in policies if registry.known(text.partition(":")[0])}
    out: dict[str, list[Row]] = {}
    for summary in summarise(rows):
        out.setdefault(_label(summary.first, given) or summary.label, []).extend(summary.rows)
    return out


def _label(row: Row, given: Mapping[str, tuple[str, dict[str, Any]]]) -> str | None:
    """The folder of an agent's training seeds, or the policy as text that names most of the parameters; else None."""
    if seed := re.search(r"([^/\\]+)[/\\]seed-\d+[/\\]", str(row.parameters.get("path", ""))):
        return seed[1]
    alike = {
        text: len(parameters)
        for text, (name, parameters) in given.items()
        if name == row.policy and _has(row.parameters, jsonable(parameters))
    }
    return max(alike, key=alike.__getitem__, default=None)


def _has(there: Any, given: Any) -> bool:
    """Whether a value is the given one; of tables, such as the options of an inner policy, the given keys count."""
    if isinstance(there, Mapping) and isinstance(given, Mapping):
        return all(key in there and _has(there[key], value) for key, value in given.items())
    return canonical(there) == canonical(given)


def _lowest(rows: Iterable[Row]) -> dict[int, float]:
    """The lowest cost of each episode, by its reset seed; costs too small for a ratio count as the smallest allowed."""
    out: dict[int, float] = {}
    for row in rows:
        out[row.seed] = min(out.get(row.seed, np.inf), max(row.total_cost, best_known.MEANINGLESS))
    return out


def _record(label: str, rows: Sequence[Row], lowest: Mapping[int, float]) -> dict[str, Any]:
    ratios, together = _cost_ratios(label, rows, lowest), Summary(rows)
    usable = ratios.min() > 0.0 and np.isfinite(ratios).all()
    low, high = geometric_interval(ratios) if usable else (None, None)
    return {
        "policy": label,
        "scenario": rows[0].scenario,
        "foresight": max(furthest(row.preview) for row in rows),
        "seeds": len(ratios),
        "episodes": ratios.shape[1],
        "relative_to": LOWEST if lowest else BEST_KNOWN,
        "cost_ratio": geometric_mean(ratios),
        "low": low,
        "high": high,
        "p90": float(np.percentile(ratios, 90)),
        "worst": float(ratios.max()),
        "lost_percent": 100.0 * together.lost / len(rows),
        "time_p50_us": together.median("time_p50_us"),
        "time_p99_us": together.largest("time_p99_us"),
    }


def _along_path(rows: Sequence[Row]) -> dict[str, float | None]:
    errors = [row.position_error_max if row.path_position_error is None else row.path_position_error for row in rows]
    return {"path_time_s": Summary(rows).path_time, "path_error_mm": 1e3 * max(errors)}


def _contacts(rows: Sequence[Row]) -> dict[str, float | None]:
    together = Summary(rows)
    stopped, clearance = together.stopped, together.smallest("clearance_min")
    return {
        "stopped_percent": None if stopped is None else 100.0 * stopped / len(rows),
        "clearance_mm": None if clearance is None else 1e3 * clearance,
    }


def _cost_ratios(label: str, rows: Sequence[Row], lowest: Mapping[int, float]) -> FloatArray:
    """One row per training seed, one column per episode. Shape (s, e)."""
    variants: dict[str, list[Row]] = {}
    for row in rows:
        variants.setdefault(canonical(row.parameters), []).append(row)
    found = [
        by_seed(some, lambda row: row.total_cost / lowest[row.seed] if lowest else row.cost_ratio or 0.0)
        for some in variants.values()
    ]
    if len({tuple(one) for one in found}) > 1:
        raise InvalidInputError(f"{label}: expected the same episodes of all training seeds.")
    return np.array([list(one.values()) for one in found])


def to_csv(lines: Sequence[Record]) -> str:
    """The records as CSV: numbers with six significant digits, None as an empty cell."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(lines[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _plain(value) for name, value in line.items()} for line in lines)
    return text.getvalue()


def from_csv(text: str) -> list[dict[str, str]]:
    """The records of a CSV file, all values as text."""
    return list(csv.DictReader(io.StringIO(text, newline="")))


def markdown(lines: Sequence[Record], columns: Sequence[str] = ()) -> str:
    """The records, or those of a CSV file, as a Markdown table with four significant digits, and units in the heads.

    The column `low` stands for the interval. All columns are shown if none is named.
    """
    names = [name for name in columns or lines[0] if not _ends(name, "high")]
    if missing := [name for name in names if name not in lines[0]]:
        raise InvalidInputError(f"columns: expected some of {', '.join(lines[0])}; got {', '.join(missing)}.")
    cells = [[_cell(line, name) for name in names] for line in lines]
    text = [i for i, name in enumerate(names) if any(_value(line[name]) is None for line in lines if line[name])]
    return grid([_head(name) for name in names], cells, text=text)


def _ends(name: str, end: str) -> bool:
    return name == end or name.endswith(f"_{end}")


def _plain(value: Any) -> Any:
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _head(name: str) -> str:
    if _ends(name, "low"):
        return "95 %"
    words, _, unit = name.rpartition("_")
    words, unit = (words, f" [{UNITS[unit]}]") if words and unit in UNITS else (name, "")
    return words.replace("times_", "× ").replace("time_p", "p").replace("_", " ") + unit


def _cell(line: Record, name: str) -> str:
    value = line[name]
    if value in ("", None):
        return NOTHING
    if _ends(name, "low"):
        return f"{number(float(value))} … {number(float(line[name.removesuffix('low') + 'high']))}"
    if name in CODE:
        return code(str(value)).replace("|", "\\|")
    found = _value(value)
    if found is None:
        return escaped(str(value))
    if found.is_integer() and "." not in str(value):
        return f"{found:,.0f}"
    if name.endswith("_percent"):
        return f"{found:.2g}" if found < 10.0 else f"{found:.0f}"
    return f"{found:,.0f}" if name.endswith("_us") and found >= 10.0 else number(found)


def _value(cell: Any) -> float | None:
    """The number in a cell; None for text."""
    try:
        return float(cell)
    except ValueError:
        return None
