"""JSON that lies in the tree: numbers of few digits, and one item of a long list a line."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

#: Significant digits of costs that are kept.
DIGITS = 7


def rounded(value: float, digits: int = 4) -> float:
    """A number with so many significant digits."""
    return float(f"{value:.{digits}g}")


def one_line(values: Mapping[str, Any]) -> str:
    """An object on a line."""
    return json.dumps(values, ensure_ascii=False, allow_nan=False)


def with_list(values: Mapping[str, Any], name: str, items: Iterable[str]) -> str:
    """The JSON of an object with one more member, a list with each item on lines of its own."""
    return f'{one_line(values)[:-1]}, "{name}": [\n' + ",\n".join(items) + "\n]}"
