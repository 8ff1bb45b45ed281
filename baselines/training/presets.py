"""Presets: options of a method in a TOML file, by the names of the fields of its configuration."""

from __future__ import annotations

import pathlib
import tomllib
from typing import Any

from baselines.training.config.base import Config
from ikgym.exceptions import InvalidInputError, UnknownNameError

#: The presets that come with the training: a table for each, with a table for each method.
FILE = pathlib.Path(__file__).with_name("presets.toml")


def names() -> tuple[str, ...]:
    """The presets that come with the training."""
    return tuple(_read(FILE))


def configure(kind: type[Config], preset: str | None) -> Config:
    """The configuration of a method from a preset.

    Args:
        kind: The class of the configuration.
        preset: One of :func:`names`, or a file ``NAME.toml`` with options; None for the defaults.

    Raises:
        UnknownNameError: There is no such preset, or the method has no such option.
        InvalidInputError: The preset is for another method, the file cannot be read, or a value is refused.
    """
    if preset is None:
        return kind()
    if preset.endswith(".toml"):
        return kind.from_json(_read(pathlib.Path(preset)))
    tables = _read(FILE)
    if preset not in tables:
        raise UnknownNameError("preset", preset, tables)
    if kind.method not in tables[preset]:
        raise InvalidInputError(f"The preset {preset} is for {', '.join(tables[preset])}, not for {kind.method}.")
    return kind.from_json(tables[preset][kind.method])


def _read(file: pathlib.Path) -> dict[str, Any]:
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as e:
        raise InvalidInputError(f"Cannot read the preset {file}: {e}.") from None
