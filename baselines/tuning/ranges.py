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
import math
import pathlib
import tomllib
from collections.abc import Iterator, Mapping, Sequence
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
        if not -math.inf < low < high < math.inf or (self.log and low <= 0.0):
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
    if not isinstance(table, Mapping) or not all(isinstance(line, Mapping) for line in table.values()):
        raise InvalidInputError(
            f"The ranges {file}: expected a table of ranges by parameter in {name!r}, got {table!r}."
        )
    out: list[Range] = []
    for parameter, line in table.items():
        out.append(_range(parameter, line))
        known_names(f"parameter above {parameter}", out[-1].when, [one.name for one in out[:-1]])
    return tuple(out)


def _range(parameter: str, line: Mapping[str, Any]) -> Range:
    known_names("key of a range", line, [field.name for field in dataclasses.fields(Range)][1:])
    choices, when = line.get("choices", []), line.get("when", {})
    if not isinstance(choices, list) or not isinstance(line.get("log", False), bool):
        raise InvalidInputError(f"range of {parameter}: expected a list of choices, and log as true or false.")
    if not isinstance(when, Mapping) or not all(isinstance(values, list) and values for values in when.values()):
        raise InvalidInputError(f"range of {parameter}: expected when as a table of lists of values, got {when!r}.")
    return Range(parameter, **{**line, "choices": tuple(choices)})


def suggested(trial: Trial, ranges: Sequence[Range], given: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters that a trial tries, those with a dot within what is given of the parameter that they are in."""
    out: dict[str, Any] = {}
    for one in ranges:
        if all(out.get(name) in values for name, values in one.when.items()):
            out |= _placed(one.name, one.suggest(trial), {**given, **out})
    return out


def ends(ranges: Sequence[Range], given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Each parameter by itself at the ends of its range, or with each of its choices, to see whether they are taken."""
    for one in ranges:
        needed = {name: values[0] for name, values in one.when.items()}
        for value in one.choices or (one.low, one.high):
            yield needed | _placed(one.name, value, {**given, **needed})


def _placed(name: str, value: object, given: Mapping[str, Any]) -> dict[str, Any]:
    """A parameter by its name; of one that it is in, the rest is as given."""
    outer, _, inner = name.partition(".")
    return {outer: {**given.get(outer, {}), inner: value} if inner else value}
