"""A table of figures with their units: as text and as Markdown."""

from __future__ import annotations

import dataclasses

from baselines.evaluation.table import number


@dataclasses.dataclass(frozen=True)
class Column:
    """A column of a table.

    Args:
        key: Its name.
        title: Its head.
        unit: Of its figures, empty for pure numbers.
    """

    key: str
    title: str
    unit: str = ""

    @property
    def head(self) -> str:
        """Title and unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


@dataclasses.dataclass(frozen=True)
class Table:
    """Figures that were measured in one interleaved run, and so can be compared.

    Args:
        key: The table's name.
        title: What was measured.
        conditions: How, in sentences.
        columns: The figures' names and units.
        rows: The figures by what they belong to, None where there is none.
        skipped: What could not be measured, and why.
    """

    key: str
    title: str
    conditions: str
    columns: tuple[Column, ...]
    rows: dict[str, tuple[float | None, ...]]
    skipped: tuple[str, ...] = ()

    def cells(self) -> list[list[str]]:
        """Head and rows in words."""
        head = ["", *(column.head for column in self.columns)]
        return [head, *([name, *(number(value) for value in row)] for name, row in self.rows.items())]

    def text(self) -> str:
        """For the terminal, without the conditions."""
        cells = self.cells()
        widths = [max(len(line[i]) for line in cells) for i in range(len(cells[0]))]
        lines = [
            "  ".join([line[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True))])
            for line in cells
        ]
        return "\n".join([self.title, *(f"  {line}".rstrip() for line in lines), *map(_left_out, self.skipped)])

    def markdown(self) -> str:
        """For a README, with its heading and conditions."""
        head, *rows = (f"| {' | '.join(line)} |" for line in self.cells())
        ruler = f"| :-- |{' --: |' * len(self.columns)}"
        notes = [f"- {_left_out(why)}" for why in self.skipped]
        return "\n".join(
            [f"## {self.title}", "", self.conditions, "", head, ruler, *rows, *([""] if notes else []), *notes]
        )


def _left_out(why: str) -> str:
    return f"left out: {why}"
