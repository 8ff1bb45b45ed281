"""Ranges of parameters, as tables of a TOML file, and what Optuna suggests from them.

A table is called like what it is for, a solver's specification or a method of training, and has one line a parameter:

    [dls]
    gain = { low = 0.003, high = 1.5, log = true }     # a float; whole numbers where both ends are
    saturation = { choices = ["clip", "scale"] }

A parameter with a dot is in a parameter that is a table itself: ``"options.gain"``. One with ``when = { rule =
["chan"] }`` is tried where a parameter above it has one of some values, and left as it is elsewhere.
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
import tomllib
from collections.abc import Mapping
from typing import Any

from optuna.trial import Trial

from baselines.canonical import DIGITS, rounded
from baselines.files import read_bytes
from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_names

# Bytes of a file that are read at most.
MOST = 2**20


@dataclasses.dataclass(frozen=True)
class Range:
    """The values that a parameter may have: from one number to another, or some.

    Args:
        name: Of the parameter; with a dot where it is in another one.
        low: The lowest value.
        high: The highest value; a whole number where both ends are.
        log: Whether equal ratios are equally likely, not equal differences.
        choices: The values, instead of two ends.
        when: The values of other parameters, by name, with which it is tried; with all if left out.

    Raises:
        InvalidInputError: There are neither two ends nor choices, or no values between the ends.
    """

    name: str
    low: float | None = None
    high: float | None = None
    log: bool = False
    choices: tuple[Any, ...] = ()
    when: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        ends: list[object] = [self.low, self.high]
        if self.choices and ends == [None, None] and not self.log:
            return
        if self.choices or any(isinstance(x, bool) or not isinstance(x, (int, float)) for x in ends):
            raise InvalidInputError(
                f"range of {self.name}: expected low and high, two numbers, or choices, got {ends} and {self.choices}."
            )
        low, high = self.low or 0.0, self.high or 0.0
        if not low < high or (self.log and low <= 0.0):
            raise InvalidInputError(
                f"range of {self.name}: expected low below high, above 0 where log is true, got {self.low} and "
                f"{self.high}."
            )

    def suggest(self, trial: Trial) -> Any:
        """The value that is tried, a float with seven digits."""
        if self.choices:
            # Optuna keeps text and numbers; a list goes by its JSON.
            values = {json.dumps(value): value for value in self.choices}
            return values[trial.suggest_categorical(self.name, list(values))]
        low: Any = self.low
        high: Any = self.high
        if isinstance(low, int) and isinstance(high, int):
            return trial.suggest_int(self.name, low, high, log=self.log)
        return rounded(trial.suggest_float(self.name, low, high, log=self.log), DIGITS)


#: The ranges of each table of a file.
Ranges = Mapping[str, tuple[Range, ...]]


def read(file: pathlib.Path) -> Ranges:
    """The ranges of a file.

    Raises:
        InvalidInputError: It cannot be read, is no TOML, or a range is none.
        UnknownNameError: A range has a key that there is not.
    """
    try:
        tables = tomllib.loads(read_bytes(file, MOST).decode())
    except OSError as e:
        raise InvalidInputError(f"Cannot read the ranges {file}: {e.strerror}.") from None
    except (ValueError, RecursionError) as e:
        raise InvalidInputError(f"The ranges {file} are no TOML: {e}.") from None
    return {name: _table(file, name, table) for name, table in tables.items()}


def _table(file: pathlib.Path, name: str, table: object) -> tuple[Range, ...]:
    keys = [field.name for field in dataclasses.fields(Range)][1:]
    if not isinstance(table, Mapping) or not all(isinstance(line, Mapping) for line in table.values()):
        raise InvalidInputError(
            f"The ranges {file}: expected a table of ranges by parameter in {name!r}, got {table!r}."
        )
    for line in table.values():
        known_names("key of a range", line, keys)
    return tuple(
        Range(parameter, **{**line, "choices": tuple(line.get("choices", ()))}) for parameter, line in table.items()
    )


def suggested(trial: Trial, ranges: tuple[Range, ...], given: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters that a trial tries, those with a dot within what is given of the parameter that they are in."""
    out: dict[str, Any] = {}
    for one in ranges:
        if any(out.get(name) not in values for name, values in one.when.items()):
            continue
        outer, _, inner = one.name.partition(".")
        value = one.suggest(trial)
        out[outer] = {**given.get(outer, {}), **out.get(outer, {}), inner: value} if inner else value
    return out
