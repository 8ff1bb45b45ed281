"""Tables of figures as text and Markdown, and the report with all of them."""

from __future__ import annotations

import dataclasses
import importlib.metadata
from collections.abc import Mapping, Sequence
from typing import Any

from baselines.evaluation.metrics import describe
from baselines.evaluation.table import grid, number

#: Libraries whose versions are stated, besides those of :func:`baselines.evaluation.metrics.describe`.
LIBRARIES = ("gymnasium", "mujoco", "envpool", "pin", "casadi", "stable-baselines3", "torch")


@dataclasses.dataclass(frozen=True)
class Table:
    """Figures that were measured in one interleaved run, and so can be compared.

    Args:
        title: The heading.
        conditions: How the figures were measured, in sentences.
        columns: The heads of the columns, with their units.
        rows: The figures by name, None for a missing one.
        skipped: Rows that could not be measured, and why.
    """

    title: str
    conditions: str
    columns: tuple[str, ...]
    rows: dict[str, tuple[float | None, ...]]
    skipped: tuple[str, ...] = ()

    def markdown(self) -> str:
        """With heading and conditions."""
        cells = [[name, *map(number, row)] for name, row in self.rows.items()]
        notes = ["", *(f"- left out: {why}" for why in self.skipped)] if self.skipped else []
        table = grid(["", *self.columns], cells, text=[0])
        return "\n".join([f"## {self.title}", "", self.conditions, "", table, *notes])


def page(tables: Sequence[Table], run: Mapping[str, Any]) -> str:
    """All tables in Markdown, with the facts about the run, the machine, and the versions of the libraries."""
    facts = {**run, **describe(), **{name: _version(name) for name in LIBRARIES}}
    parts = [
        "# Speed",
        "Figures of one table come from one run and are medians of interleaved rounds unless it says otherwise, so "
        "that ratios hold on a noisy machine. Figures of different tables do not compare as well.",
        *(table.markdown() for table in tables),
        "## Conditions",
        "\n".join(f"- {key}: {value}" for key, value in facts.items()),
    ]
    return "\n\n".join(parts) + "\n"


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"
