"""Ranges of parameters that a search varies.

A file of ranges has a table a solver, called by its specification, with one line a parameter:

    [mfac]
    damping = { low = 1e-6, high = 1.0, log = true }     # a float; an integer if both ends are integers
    rule = { choices = ["constant", "chan"] }

A parameter with a dot is a key of a parameter that is a table itself: ``"options.gain"``. One with ``when = { rule =
["chan"] }`` is varied only if a parameter above it has one of these values.
"""

from __future__ import annotations

import json
import pathlib
from collections.abc import Mapping
from typing import Any

from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.trial import Trial

from baselines import registry
from baselines.registry import parse_policy
from ikgym.exceptions import InvalidInputError
from ikgym.files import read_user_toml
from ikgym.validation import known_names

#: The ranges that come with the solvers.
RANGES = pathlib.Path(__file__).parents[1] / "data" / "ranges.toml"

#: Significant digits of costs and parameters that are kept.
DIGITS = 7

#: How a parameter is varied: low, high, log, choices, when.
Range = Mapping[str, Any]


def read_ranges(file: pathlib.Path) -> dict[str, dict[str, Range]]:
    """The ranges in a TOML file, by solver and parameter.

    Raises:
        InvalidInputError: The file cannot be read, or a range is invalid.
        UnknownNameError: A range has an unknown key.
    """
    tables = read_user_toml(file)
    for spec, table in tables.items():
        for name, line in table.items() if isinstance(table, dict) else [("", table)]:
            if not isinstance(line, dict):
                raise InvalidInputError(f"{file}: expected a table of ranges by parameter in [{spec}], got {line!r}.")
            known_names("key of a range", line, ("low", "high", "log", "choices", "when"))
            known_names(f"parameter above {name}", line.get("when", {}), list(table)[: list(table).index(name)])
            try:
                _distribution(line)
            except (KeyError, TypeError, ValueError) as e:
                raise InvalidInputError(f"{file}: [{spec}] {name}: expected low and high, or choices: {e}.") from None
    return tables


def _distribution(line: Range) -> CategoricalDistribution | FloatDistribution | IntDistribution:
    if "choices" in line:
        return CategoricalDistribution([json.dumps(value) for value in line["choices"]])  # lists are no choices
    low, high, log = line["low"], line["high"], line.get("log", False)
    kind = IntDistribution if isinstance(low, int) and isinstance(high, int) else FloatDistribution
    return kind(low, high, log=log)


def ranges_of(spec: str, ranges: Mapping[str, Mapping[str, Range]]) -> Mapping[str, Range]:
    """The ranges of a solver: the table of its specification, or of its name without the given parameters.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: There are none.
    """
    name, given = parse_policy(spec)
    other = {key: line for key, line in ranges.get(name, {}).items() if key.partition(".")[0] not in given}
    found = ranges.get(spec) or other
    keys = [key.partition(".")[0] for key in found]
    known_names(f"parameter of {name}", keys, registry.get(name).parameter_names())
    if not found:
        raise InvalidInputError(
            f"There are no ranges for the parameters of {spec!r}: add a table of that name to --ranges FILE.toml. "
            f"There are ranges for: {', '.join(ranges)}."
        )
    return found


def suggest(trial: Trial, ranges: Mapping[str, Range], given: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters of a trial; a name with a dot replaces one key of a given parameter."""
    out: dict[str, Any] = {}
    for name, line in ranges.items():
        if any(out.get(other) not in values for other, values in line.get("when", {}).items()):
            continue
        kind, value = _distribution(line), None
        if isinstance(kind, CategoricalDistribution):
            value = json.loads(str(trial.suggest_categorical(name, kind.choices)))
        elif isinstance(kind, IntDistribution):
            value = trial.suggest_int(name, kind.low, kind.high, log=kind.log)
        else:
            value = round_digits(trial.suggest_float(name, kind.low, kind.high, log=kind.log))
        out |= nest(name, value, {**given, **out})
    return out


def nest(name: str, value: object, given: Mapping[str, Any]) -> dict[str, Any]:
    """The parameter that a name with a dot belongs to, with one key changed and the other given ones kept."""
    outer, _, inner = name.partition(".")
    return {outer: {**given.get(outer, {}), inner: value} if inner else value}


def round_digits(value: float) -> float:
    """A number with :data:`DIGITS` significant digits."""
    return float(f"{value:.{DIGITS}g}")
