"""Presets: options of a method in a TOML file, by the names that they have in its configuration.

A file may name its ``method``; one that does not is for all methods that have its options. A file of tables, each
named after a method, is for these.
"""

from __future__ import annotations

import pathlib
import tomllib
from typing import Any

from baselines.files import read_bytes
from baselines.spec import refuse_trust
from baselines.training.config.base import Config
from ikgym.exceptions import InvalidInputError, UnknownNameError

FOLDER = pathlib.Path(__file__).parent
# Bytes of a file that are read at most.
MOST = 2**20


def names() -> tuple[str, ...]:
    """The presets that come with the training."""
    return tuple(sorted(file.stem for file in FOLDER.glob("*.toml")))


def read(preset: str) -> dict[str, Any]:
    """The options of a preset.

    Args:
        preset: One of :func:`names`, or the path of a file that ends in ``.toml``.

    Raises:
        UnknownNameError: There is no such preset; the message has the nearest name.
        InvalidInputError: The file cannot be read, is no TOML, or trusts the file of an agent.
    """
    file = pathlib.Path(preset) if preset.endswith(".toml") else FOLDER / f"{preset}.toml"
    if file.parent == FOLDER and preset not in names():
        raise UnknownNameError("preset", preset, names())
    try:
        options = tomllib.loads(read_bytes(file, MOST).decode())
    except OSError as e:
        raise InvalidInputError(f"Cannot read the preset {file}: {e.strerror}.") from None
    except RecursionError:
        raise InvalidInputError(f"The preset {file} is nested too deeply.") from None
    except ValueError as e:
        raise InvalidInputError(f"The preset {file} is no TOML: {e}.") from None
    for table in (options, *_tables(options).values()):
        for name in {"base_policy", "expert"} & table.keys():
            refuse_trust(table[name], f"The preset {file}: {name}")
    return options


def configure(kind: type[Config], preset: str | None) -> tuple[Config, frozenset[str]]:
    """A method's configuration from a preset.

    Args:
        kind: The class of the configuration.
        preset: As in :func:`read`; None for the defaults.

    Returns:
        The configuration, and the names of the options that the preset gives.

    Raises:
        UnknownNameError: There is no such preset, or the method has no option that it gives.
        InvalidInputError: The preset is for another method, or a value is refused.
    """
    options = {} if preset is None else read(preset)
    meant = methods_of(options)
    if meant and kind.method not in meant:
        raise InvalidInputError(f"The preset {preset} is for {', '.join(meant)}, not for {kind.method}.")
    options = _tables(options).get(kind.method, options)
    options.pop("method", None)
    return kind.from_json(options), frozenset(options)


def methods_of(options: dict[str, Any]) -> tuple[str, ...]:
    """The methods that the options of a preset are for; none for those that are for all."""
    tables = tuple(_tables(options))
    return tables or ((options["method"],) if "method" in options else ())


def _tables(options: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Options by method."""
    return {name: table for name, table in options.items() if isinstance(table, dict)}
