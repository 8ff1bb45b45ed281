"""A writer of TOML, which Python reads but does not write; matrices stand in rows, one a line."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np


def document(values: Mapping[str, Any]) -> str:
    """The text of a TOML file, in which every number reads as the very same number.

    Values are texts, truth values, numbers, arrays, sequences of them, and mappings, which become tables; None is left
    out. Keys consist of letters, digits and ``_``.
    """
    return "\n".join(_lines(values, "")) + "\n"


def _lines(values: Mapping[str, Any], within: str) -> list[str]:
    """The lines of a table, its own values first."""
    given = {key: value for key, value in values.items() if value is not None}
    lines = [f"{key} = {_text(value)}" for key, value in given.items() if not isinstance(value, Mapping)]
    for key, value in given.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{within}{key}]", *_lines(value, f"{within}{key}.")]
    return lines


def _text(value: Any) -> str:
    if isinstance(value, str):
        # JSON escapes all that TOML wants escaped but the character 127.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return repr(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, Mapping):  # in a list of tables
        return "{ " + ", ".join(f"{key} = {_text(part)}" for key, part in value.items() if part is not None) + " }"
    if isinstance(value, np.ndarray) and value.ndim > 1:
        return "[\n" + "".join(f"  {_text(row)},\n" for row in value) + "]"
    if isinstance(value, Iterable):
        return "[" + ", ".join(map(_text, value)) + "]"
    raise TypeError(f"{value!r} has no form in TOML.")  # a fault of ours: callers pass nothing else
