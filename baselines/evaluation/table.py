"""Tables as plain text, HTML, Markdown and CSV."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from baselines.evaluation.columns import COLUMNS, NOTHING, Column, interval, number
from baselines.files import csv_text
from ikgym.exceptions import InvalidInputError

if TYPE_CHECKING:  # slow to import, and not needed for names
    import pandas as pd

#: The value of a cell without one, for sorting.
LAST = 1e300
#: Longest name of a policy in a line of a plain table; longer ones have a separate line.
LONGEST = 20
#: Columns that Markdown sets as code.
CODE = ("policy", "scenario", "agent", "solver", "beside")


def plain(chosen: Sequence[Column], lines: pd.DataFrame, width: int) -> tuple[str, list[Column]]:
    """A table as plain text: policies first, columns closer together if they would not fit.

    Returns:
        The text, and columns that are left out since even then they do not fit.
    """
    kept, texts = list(chosen), {column.key: [column.title, column.unit, *column.cells(lines)] for column in chosen}
    sizes = {
        column.key: max(n for n in map(_width, texts[column.key]) if column.key != "label" or n <= LONGEST)
        for column in chosen
    }

    def room(gap: int) -> int:
        return sum(sizes[column.key] for column in kept) + gap * (len(kept) - 1)

    for column in sorted(chosen, key=lambda column: -column.drop):
        if not column.drop or room(1) <= width:
            break
        kept.remove(column)
    gap = 2 if room(2) <= width else 1
    rows = []
    for line in zip(*(texts[column.key] for column in kept), strict=True):
        padded = [
            text + blank if column.format is str else blank + text
            for column, text in zip(kept, line, strict=True)
            for blank in [" " * (sizes[column.key] - _width(text))]
        ]
        if _width(line[0]) > LONGEST:  # a long name has a separate line
            padded[0] = f"{line[0]}\n{' ' * sizes[kept[0].key]}"
        rows.append((" " * gap).join(padded).rstrip())
    heads = rows[: 1 + any(column.unit for column in kept)]
    return "\n".join([*heads, "-" * room(gap), *rows[2:]]), [column for column in chosen if column not in kept]


def _width(text: str) -> int:
    """Columns that a text takes on a terminal: the dot of q̇ has none."""
    return len(text) - text.count("\u0307")


def html(chosen: Sequence[Column], lines: pd.DataFrame) -> str:
    """A table as HTML, complete without scripts; the value of a line's checkbox is its number."""
    heads = [("policy", "* has privileged information, ‡ free timing"), ("scenario", "name of the scenario")]
    heads += [(column.head, column.about) for column in chosen]
    out = ['<table id="results"><thead><tr><th class="pick" scope="col" aria-label="in the plots"></th>']
    out += [f'<th scope="col" title="{escape(about)}">{escape(title)}</th>' for title, about in heads]
    out.append("</tr></thead><tbody>")
    cells = [column.cells(lines) for column in chosen]
    for place, line in enumerate(lines.itertuples(index=False)):
        name, scenario = escape(line.label + " *" * line.reference + " ‡" * line.free_timing), escape(line.scenario)
        out.append(
            f'<tr><td class="pick"><input type="checkbox" value="{place}" aria-label="{name} in {scenario}: show in '
            f'the plots"></td><th scope="row" class="name">{name}</th><td>{scenario}</td>'
        )
        for column, texts in zip(chosen, cells, strict=True):
            value, text, attributes = getattr(line, column.key), escape(texts[place]), ""
            if column.format is not str:
                order = value if text != NOTHING and math.isfinite(value) else LAST
                attributes = f' class="number" data-order="{order}"'
            out.append(f"<td{attributes}>{text}</td>")
        out.append("</tr>")
    return "".join([*out, "</tbody></table>"])


def records(lines: pd.DataFrame | Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The lines of a frame, or lines as they are."""
    return list(lines.to_dict("records") if hasattr(lines, "to_dict") else lines)


def to_csv(lines: pd.DataFrame | Iterable[Mapping[str, Any]]) -> str:
    """Lines as CSV: numbers with six significant digits, None and NaN as an empty cell."""

    def cell(value: Any) -> Any:
        return (None if math.isnan(value) else float(f"{value:.6g}")) if isinstance(value, float) else value

    rows = records(lines)
    return csv_text(rows[0], ([cell(line[name]) for name in rows[0]] for line in rows))


def from_csv(text: str) -> list[dict[str, str]]:
    """The lines of a CSV file, all values as text."""
    return list(csv.DictReader(io.StringIO(text, newline="")))


def markdown(lines: pd.DataFrame | Iterable[Mapping[str, Any]], names: Sequence[str] = ()) -> str:
    """Lines, or those of a CSV file, as a Markdown table with four significant digits, and units in the heads.

    Heads are those of :class:`Column`. An interval is a pair of columns `low` and `high`, possibly with a prefix; the
    column `low` shows it. All columns are shown if none is named.

    Raises:
        InvalidInputError: There is no column of a name.
    """
    rows = records(lines)
    names = [name for name in names or rows[0] if not f"_{name}".endswith("_high")]
    if missing := [name for name in names if name not in rows[0]]:
        raise InvalidInputError(f"columns: expected some of {', '.join(rows[0])}; got {', '.join(missing)}.")
    text = [i for i, name in enumerate(names) if any(_number(line[name]) is None for line in rows if line[name])]
    heads = [COLUMNS.get(name, Column(name)).head for name in names]
    return grid(heads, ([_cell(line, name) for name in names] for line in rows), text=text)


def _cell(line: Mapping[Any, Any], name: str) -> str:
    value = line[name]
    if value in ("", None) or value != value:
        return NOTHING
    if f"_{name}".endswith("_low"):
        return interval(float(value), float(line[name.removesuffix("low") + "high"]))
    if name in CODE:
        return code(str(value)).replace("|", "\\|")
    found = _number(value)
    if found is None:
        return escape_markdown(str(value))
    if found.is_integer() and "." not in str(value):
        return f"{found:,.0f}"
    if name.endswith("_percent"):
        return f"{found:.2g}" if found < 10.0 else f"{found:.0f}"
    return f"{found:,.0f}" if name.endswith("_us") and found >= 10.0 else number(found)


def _number(cell: Any) -> float | None:
    """The number in a cell; None for text."""
    try:
        return float(cell)
    except (TypeError, ValueError):
        return None


def escape_markdown(text: str) -> str:
    """A text that Markdown, and MDX, shows letter by letter in one line; tags and expressions in it do not run."""
    return re.sub(r"[\\`*{}\[\]<>&#|~!$]|(?<![^\W_])_|_(?![^\W_])", r"\\\g<0>", " ".join(text.split()))


def code(text: str) -> str:
    """A text as code in Markdown, in one line."""
    line = " ".join(text.split())
    fence = "`" * (1 + max(map(len, re.findall("`+", line)), default=0))
    return f"{fence} {line} {fence}" if "`" in line else f"{fence}{line}{fence}"


def grid(head: Iterable[str], lines: Iterable[Sequence[str]], *, text: Sequence[int] = ()) -> str:
    """A Markdown table of cells; the columns whose numbers are in `text` are aligned to the left."""
    head = list(head)
    rules = [":--" if column in text else "--:" for column in range(len(head))]
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, rules, *lines))
