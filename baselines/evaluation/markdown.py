"""Tables of Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(head: Sequence[str], lines: Iterable[Sequence[str]], *, text: Sequence[int] = ()) -> list[str]:
    """A table of numbers, but for some columns, which are set to the left.

    Args:
        head: The names of the columns.
        lines: The cells.
        text: The numbers of the columns that hold text.
    """
    rules = [":--" if column in text else "--:" for column in range(len(head))]
    return [f"| {' | '.join(line)} |" for line in (head, rules, *lines)]
