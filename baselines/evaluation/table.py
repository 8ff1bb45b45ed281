"""Tables of records as plain text and HTML, and numbers and names as text."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Iterable, Sequence
from html import escape

from baselines.evaluation.summary import Record

#: The text of a cell without a value, and its value for sorting.
NOTHING, LAST = "–", 1e300
#: Longest name of a policy in a line of a plain table; longer ones have a line of their own.
LONGEST = 20


def number(value: float | None) -> str:
    """A number with four significant digits: ``1234``, ``0.01235``, ``1.235e7``; a dash for none."""
    if value is None or math.isnan(value):
        return NOTHING
    if value == 0.0:
        return "0"
    digits = f"{value:#.4g}"
    mantissa, _, exponent = digits.partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa.removesuffix(".")


@dataclasses.dataclass(frozen=True)
class Column:
    """A column of a table of records."""

    title: str  # its head
    unit: str  # the second line of the head
    name: str  # what records call its value: a float, an integer, a text, or None
    about: str = ""  # a description, shown in HTML when the pointer is on the head
    drop: int = 0  # if a line is too short, columns are left out from the highest number down; those with 0 stay
    text: Callable[[Record], str] | None = None  # the text of a cell, if it is not that of its value

    @property
    def head(self) -> str:
        """The head in one line."""
        return f"{self.title} {self.unit}".strip()

    def cell(self, line: Record) -> str:
        """The text of a cell."""
        if self.text is not None:
            return self.text(line)
        value = line[self.name]
        return str(value) if isinstance(value, (int, str)) else number(value)

    def left(self, line: Record) -> bool:
        """Whether cells are aligned to the left, as text is."""
        return isinstance(line[self.name], str)


def fitting(columns: Sequence[Column], lines: Sequence[Record], width: int) -> list[Column]:
    """The columns that fit a line."""
    kept = filled(columns, lines)
    for column in sorted(kept, key=lambda column: -column.drop):
        rule = next(line for line in plain(kept, lines, 0).splitlines() if set(line) == {"-"})
        if not column.drop or len(rule) <= width:
            break
        kept.remove(column)
    return kept


def filled(columns: Iterable[Column], lines: Sequence[Record]) -> list[Column]:
    """The columns that have a value in some line."""
    return [column for column in columns if any(column.cell(one) != NOTHING for one in lines)]


def plain(columns: Sequence[Column], lines: Sequence[Record], width: int) -> str:
    """A table as plain text: policies first, columns closer together if they would not fit, empty ones left out."""
    columns = filled(columns, lines)
    heads = [[column.title for column in columns], [column.unit for column in columns]]
    heads, body = heads[: 1 + any(heads[1])], [[column.cell(one) for column in columns] for one in lines]
    sizes = [max(_width(line[i]) for line in [*heads, *body]) for i in range(len(columns))]
    sizes[0] = max(size for line in [*heads, *body] if (size := _width(line[0])) <= LONGEST)
    gap = "  " if sum(sizes) + 2 * (len(columns) - 1) <= width else " "
    left = [column.left(lines[0]) for column in columns]

    def padded(line: Sequence[str]) -> str:
        blanks = [" " * (size - _width(text)) for text, size in zip(line, sizes, strict=True)]
        cells = [
            text + blank if leftwards else blank + text
            for text, blank, leftwards in zip(line, blanks, left, strict=True)
        ]
        if _width(line[0]) > LONGEST:
            cells[0] = f"{line[0]}\n{' ' * sizes[0]}"
        return gap.join(cells).rstrip()

    rule = "-" * (sum(sizes) + len(gap) * (len(columns) - 1))
    return "\n".join([*map(padded, heads), rule, *map(padded, body)])


def _width(text: str) -> int:
    """Columns that a text takes on a terminal: the dot of q̇ has none of its own."""
    return len(text) - text.count("\u0307")


def html(columns: Sequence[Column], lines: Sequence[Record]) -> str:
    """A table as HTML, complete without scripts; the value of a line's checkbox is its number."""
    columns = filled(columns, lines)
    heads = [("policy", "* has privileged information, ‡ free timing"), ("scenario", "name of the scenario")]
    heads += [(column.head, column.about) for column in columns]
    out = ['<table id="results"><thead><tr><th class="pick" scope="col" aria-label="in the plots"></th>']
    out += [f'<th scope="col" title="{escape(about)}">{escape(title)}</th>' for title, about in heads]
    out.append("</tr></thead><tbody>")
    for place, line in enumerate(lines):
        name = escape(line["policy"] + " *" * line["reference"] + " ‡" * line["free_timing"])
        scenario = escape(line["scenario"])
        out += [
            f'<tr><td class="pick"><input type="checkbox" value="{place}" aria-label="{name} in {scenario}: show in '
            f'the plots"></td><th scope="row" class="name">{name}</th><td>{scenario}</td>'
        ]
        for column in columns:
            value, text = line[column.name], escape(column.cell(line))
            shown = text != NOTHING and isinstance(value, (int, float)) and math.isfinite(value)
            order = value if shown else LAST
            out.append(
                f"<td>{text}</td>" if isinstance(value, str) else f'<td class="number" data-order="{order}">{text}</td>'
            )
        out.append("</tr>")
    return "".join([*out, "</tbody></table>"])


def escaped(text: str) -> str:
    """A text that Markdown, and MDX, shows letter by letter in one line; tags and expressions in it do not run."""
    return re.sub(r"[\\`*{}\[\]<>&#|~!$]|(?<![^\W_])_|_(?![^\W_])", r"\\\g<0>", " ".join(text.split()))


def code(text: str) -> str:
    """A text as code in Markdown, in one line."""
    line = " ".join(text.split())
    fence = "`" * (1 + max(map(len, re.findall("`+", line)), default=0))
    return f"{fence} {line} {fence}" if "`" in line else f"{fence}{line}{fence}"


def grid(head: Sequence[str], lines: Iterable[Sequence[str]], *, text: Sequence[int] = ()) -> str:
    """A Markdown table of cells; the columns whose numbers are in `text` are aligned to the left."""
    rules = [":--" if column in text else "--:" for column in range(len(head))]
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, rules, *lines))
