"""A writer of TOML tables, and a check of what was read from one.

Python reads TOML and does not write it. What scenario files need of it is little, so that this stays free of a
dependency, and matrices stand in rows, which the libraries for it write one number a line.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

import numpy as np

from ikgym.exceptions import InvalidInputError

Value = TypeVar("Value")


def document(values: Mapping[str, Any]) -> str:
    """The text of a TOML file.

    Args:
        values: Texts, truth values, numbers, arrays, sequences of them, and mappings, which become tables, within
            each other, too. Keys are of letters, digits and ``_``. What is None is left out.

    Returns:
        The text; every number reads as the very same number.
    """
    return "\n".join(_lines(values, "")) + "\n"


def checked(table: Mapping[str, Any], key: str, kind: type[Value], meant: str) -> Value:
    """The value of a key, if it is of the right type.

    Raises:
        InvalidInputError: The table has no such key, or its value is of another type.
    """
    if key not in table:
        raise InvalidInputError(f"{key}: expected {meant}, got no such key.")
    value = table[key]
    if not isinstance(value, kind):
        raise InvalidInputError(f"{key}: expected {meant}, got {value!r}.")
    return value


def only_numbers(key: str, value: object) -> None:
    """Insists on a number or on nested arrays of them; a truth value is none.

    Raises:
        InvalidInputError: There is something else.
    """
    if isinstance(value, list):
        for part in value:
            only_numbers(key, part)
    elif isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InvalidInputError(f"{key}: expected numbers, got {value!r}.")


def _lines(values: Mapping[str, Any], within: str) -> list[str]:
    """The lines of a table, what belongs to itself first."""
    given = {key: value for key, value in values.items() if value is not None}
    lines = [f"{key} = {_text(value)}" for key, value in given.items() if not isinstance(value, Mapping)]
    for key, value in given.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{within}{key}]", *_lines(value, f"{within}{key}.")]
    return lines


def _text(value: Any) -> str:
    if isinstance(value, str):
        import json  # seldom needed, and slow to import

        # JSON escapes all that TOML wants escaped but the character 127.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return repr(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, Mapping):  # one of a list of tables
        return "{ " + ", ".join(f"{key} = {_text(part)}" for key, part in value.items() if part is not None) + " }"
    if isinstance(value, np.ndarray) and value.ndim > 1:
        return "[\n" + "".join(f"  {_text(row)},\n" for row in value) + "]"
    if isinstance(value, Iterable):
        return "[" + ", ".join(map(_text, value)) + "]"
    raise TypeError(f"{value!r} has no form in TOML.")  # a fault of ours: callers hand in no such thing
