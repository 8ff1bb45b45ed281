"""Comparisons of policies: ranked records, their CSV files and Markdown tables.

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
from baselines.evaluation.summary import Record, by_seed, grouped, labels, record
from baselines.evaluation.table import NOTHING, code, escaped, grid, number
from baselines.files import csv_text
from baselines.oracle import best_known
from baselines.spec import parse_policy
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray

__all__ = ["BEST_KNOWN", "LOWEST", "Record", "from_csv", "markdown", "records", "to_csv"]

#: Cost ratios where best known costs are missing: relative to the lowest cost in the table.
LOWEST = "lowest in the table"
BEST_KNOWN = "best known"
#: Columns of all records, and of those with free timing or collisions.
COLUMNS: tuple[str, ...] = (
    *("policy", "scenario", "foresight", "seeds", "episodes", "relative_to", "cost_ratio", "low", "high", "p90"),
    *("worst", "lost_percent", "time_p50_us", "time_p99_us"),
)
PATH, CONTACTS = ("path_time_s", "path_error_mm"), ("stopped_percent", "clearance_mm")
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

    Where a policy has free timing, there are two more columns: the time in which it reached the end of the path, and
    the largest distance from the reference at the policy's own progress, or on the clock of the others. Where a
    scenario has collisions, there are the share of episodes in which the arm was stopped and the smallest clearance.

    Args:
        rows: Results of an evaluation.
        policies: The policies that were evaluated, as text; each is the label of its line. Others are called by their
            name and the parameters that are not at their defaults.

    Raises:
        InvalidInputError: The training seeds of an agent have played different episodes.
    """
    out: list[dict[str, Any]] = []
    columns = COLUMNS
    columns += PATH * any(row.path_position_error is not None for row in rows)
    columns += CONTACTS * any(row.clearance_min is not None for row in rows)
    for scenario in dict.fromkeys(row.scenario for row in rows):
        here = [row for row in rows if row.scenario == scenario]
        known = all(row.cost_ratio is not None for row in here)
        lowest = {} if known else _lowest(here)
        found = []
        for label, some in _by_label(here, policies).items():
            line = record(label, some, _cost_ratios(label, some, lowest))
            line |= {"relative_to": BEST_KNOWN if known else LOWEST, "cost_ratio": line["mean"]}
            if not line["free_timing"]:
                line["path_error_mm"] = line["position_error_mm"]
            found.append({name: line[name] for name in columns})
        out += sorted(found, key=lambda one: one["cost_ratio"])
    return out


def _by_label(rows: Sequence[Row], policies: Sequence[str]) -> dict[str, list[Row]]:
    """The rows of one scenario by the label of their policy."""
    given = {text: parse_policy(text) for text in policies if registry.known(text.partition(":")[0])}
    groups = list(grouped(rows).values())
    out: dict[str, list[Row]] = {}
    for group, name in zip(groups, labels([group[0] for group in groups]), strict=True):
        out.setdefault(_label(group[0], given) or name, []).extend(group)
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
    return csv_text(lines[0], ([_plain(line[name]) for name in lines[0]] for line in lines))


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
