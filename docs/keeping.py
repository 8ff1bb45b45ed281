"""Where results lie: a table of the pages is a CSV file in `docs/results`, and a measurement under way is a folder."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from baselines.evaluation.table import from_csv, to_csv
from baselines.files import write

PAGES = Path(__file__).parent
RESULTS = PAGES / "results"
#: Evaluations lie in the first folder until their table is complete, trained agents in the second.
WORK, RUNS = Path("results") / "measure", Path("runs")
#: Episodes in which each policy is timed.
TIMED = 2
#: One line of a table: the name of each column and its value.
Line = dict[str, Any]


def lines(name: str) -> list[Line]:
    """The lines of a table, all values as text."""
    return list(map(dict, from_csv((RESULTS / f"{name}.csv").read_text(encoding="utf-8"))))


def keep(name: str, table: Iterable[Mapping[str, Any]]) -> None:
    """Writes a table."""
    write(RESULTS / f"{name}.csv", to_csv(list(table)).encode())


def resumable(name: str) -> dict[str, Any]:
    """Options of an evaluation that continues where it was killed."""
    return {"timed": TIMED, "out": WORK / name, "resume": True, "report": False, "progress": True}
