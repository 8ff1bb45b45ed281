"""Scenarios from a user's modules: ``"package.module:attribute"``."""

from __future__ import annotations

import importlib

from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.scenarios.scenario import Scenario


def imported(import_path: str) -> Scenario:
    """The scenario with an import path, whose attribute is one, or is called without arguments to make one."""
    name, _, attribute = import_path.partition(":")
    if not attribute.isidentifier() or not all(part.isidentifier() for part in name.split(".")):
        raise InvalidInputError(f"scenario: expected 'package.module:attribute', got {import_path!r}.")
    try:
        module = importlib.import_module(name)
    except Exception as error:  # whatever the code of others raises
        raise InvalidInputError(f"Scenario {import_path!r}: {name} cannot be imported: {_told(error)}") from error
    if not hasattr(module, attribute):
        public = [key for key in vars(module) if not key.startswith("_")]
        raise UnknownNameError(f"attribute of {name}", attribute, public)
    found = getattr(module, attribute)
    if callable(found):
        try:
            found = found()
        except Exception as error:
            raise InvalidInputError(f"Scenario {import_path!r}: making it failed: {_told(error)}") from error
    if not isinstance(found, Scenario):
        raise InvalidInputError(f"Scenario {import_path!r}: expected a Scenario or what makes one, got {found!r}.")
    return found


def _told(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
