"""Tables of summaries as plain text, as wide as the terminal."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

from baselines.evaluation.summary import Summary

# Of a name that stands in its line; longer ones stand above it.
LONGEST = 20


@dataclasses.dataclass(frozen=True)
class Column:
    """A column of a table.

    Args:
        title: Its head.
        unit: Stands below the head, empty for pure numbers.
        cell: The text of a summary's cell.
        left: Whether it is set to the left.
        drop: Where a line is too short, columns are left out from the highest number down; those with 0 stay.
    """

    title: str
    unit: str
    cell: Callable[[Summary], str]
    left: bool = False
    drop: int = 0


def fitting(columns: Sequence[Column], summaries: Sequence[Summary], width: int) -> tuple[list[Column], list[Column]]:
    """The columns that fit a line, and those that are left out."""
    kept = list(columns)
    for column in sorted(columns, key=lambda column: -column.drop):
        if not column.drop or _narrowest(kept, summaries) <= width:
            break
        kept.remove(column)
    return kept, [column for column in columns if column not in kept]


def _narrowest(columns: Sequence[Column], summaries: Sequence[Summary]) -> int:
    """The shortest line that holds the columns: that of the rule, since long names stand in lines of their own."""
    return next(len(line) for line in plain(columns, summaries, 0).splitlines() if set(line) == {"-"})


def plain(columns: Sequence[Column], summaries: Sequence[Summary], width: int) -> str:
    """The table.

    Args:
        columns: Its columns, the first one the names of the policies.
        summaries: Its lines.
        width: Characters that a line may have; columns stand closer together where they would not fit.
    """
    heads = [[column.title for column in columns], [column.unit for column in columns]]
    cells = heads[: 1 + any(heads[1])] + [[column.cell(summary) for column in columns] for summary in summaries]
    widths = [max(_width(line[i]) for line in cells) for i in range(len(columns))]
    widths[0] = max(_width(line[0]) for line in cells if _width(line[0]) <= LONGEST)
    gap = "  " if sum(widths) + 2 * (len(columns) - 1) <= width else " "
    lines = []
    for line in cells:
        padded = [
            text + " " * (width - _width(text)) if column.left else " " * (width - _width(text)) + text
            for text, width, column in zip(line, widths, columns, strict=True)
        ]
        if _width(line[0]) > LONGEST:  # a name with many parameters gets a line of its own
            lines.append(line[0])
            padded[0] = " " * widths[0]
        lines.append(gap.join(padded).rstrip())
    rule = "-" * (sum(widths) + len(gap) * (len(columns) - 1))
    return "\n".join([*lines[: len(cells) - len(summaries)], rule, *lines[len(cells) - len(summaries) :]])


def _width(text: str) -> int:
    """Columns that a text takes on a terminal: the dot of q̇ has none of its own."""
    return len(text) - text.count("\u0307")
