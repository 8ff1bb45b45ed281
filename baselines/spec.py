"""Policies as text: ``"dls"``, ``"dls:damping=1e-2"``, ``"agent:PATH"``, ``"package.module:Class:gain=0.5"``."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from typing import Any

from baselines import registry
from ikgym.exceptions import InvalidInputError
from ikgym.registry import IMPORT_PATH
from ikgym.validation import known_names

#: A policy as text, or its name and its parameters.
PolicySpec = str | tuple[str, Mapping[str, Any]]


def parse_policy(spec: PolicySpec) -> tuple[str, dict[str, Any]]:
    """Name or import path of a policy, and its parameters.

    Args:
        spec: ``"name"``, ``"name:parameter=value,parameter=value"`` or a pair of both; ``"agent:PATH"``, too. Instead
            of a name there may be an import path, ``"package.module:Class"``, which is not imported here. Values are
            Python's literals; anything else is taken for plain text.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: The text has another form, or names a parameter twice.
    """
    if isinstance(spec, str):
        name, colon, text = (part.strip() for part in spec.partition(":"))
        attribute, more, rest = (part.strip() for part in text.partition(":"))
        if not registry.known(name) and IMPORT_PATH.fullmatch(import_path := f"{name}:{attribute}"):
            return import_path, parse_parameters(rest, f"policy {spec!r}") if more else {}
        positional, known = registry.get(name).positional, registry.get(name).parameter_names()
        if positional is not None and text and text.partition("=")[0].strip() not in known:
            parameters: dict[str, Any] = {positional: text}
        else:
            parameters = parse_parameters(text, f"policy {spec!r}") if colon else {}
    elif isinstance(spec, tuple) and len(spec) == 2 and isinstance(spec[0], str) and isinstance(spec[1], Mapping):
        name, parameters = spec[0].strip(), dict(spec[1])
        if not registry.known(name) and IMPORT_PATH.fullmatch(name):
            return name, parameters
    else:
        raise InvalidInputError(f"policy: expected 'name:parameter=value' or (name, parameters), got {spec!r}.")
    known_names(f"parameter of {name}", parameters, registry.get(name).parameter_names())
    return name, parameters


def parse_parameters(text: str, source: str) -> dict[str, Any]:
    """Names and values of ``"name=value,name=value"``; values are Python's literals, anything else is plain text.

    Raises:
        InvalidInputError: The text has another form, or names one twice; the message begins with ``source``.
    """
    out: dict[str, Any] = {}
    for part in _split(text):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value):
            raise InvalidInputError(f"{source}: expected name=value,…, got {part.strip()!r}.")
        if name in out:
            raise InvalidInputError(f"{source}: {name!r} is given twice.")
        try:
            out[name] = ast.literal_eval(value)
        except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
            out[name] = value
    return out


def _split(text: str) -> list[str]:
    """Parts between commas outside of brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts
