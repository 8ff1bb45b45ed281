"""Policies as text: ``"dls"``, ``"dls:damping=1e-2"``, ``"agent:PATH"``."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from typing import Any

from baselines import registry
from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_names

#: A policy as text such as ``"dls:damping=1e-2"``, or its name and its parameters.
PolicySpec = str | tuple[str, Mapping[str, Any]]


def parse_policy(spec: PolicySpec) -> tuple[str, dict[str, Any]]:
    """Name and parameters of a policy.

    Args:
        spec: ``"name"``, ``"name:parameter=value,parameter=value"`` or a pair of both; ``"agent:PATH"``, too. Values
            are Python's literals; anything else is taken for plain text.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: The text has another form, or names a parameter twice.
    """
    if isinstance(spec, str):
        name, _, text = spec.partition(":")
        name = name.strip()
        alone, known = registry.get(name).positional, registry.get(name).parameter_names()
        if alone is not None and text.strip() and text.partition("=")[0].strip() not in known:
            parameters: dict[str, Any] = {alone: text.strip()}
        else:
            parameters = parse_parameters(text, f"policy {spec!r}") if ":" in spec else {}
    elif isinstance(spec, tuple) and len(spec) == 2 and isinstance(spec[0], str) and isinstance(spec[1], Mapping):
        name, parameters = spec[0], dict(spec[1])
    else:
        raise InvalidInputError(f"policy: expected 'name:parameter=value' or (name, parameters), got {spec!r}.")
    known_names(f"parameter of {name}", parameters, registry.get(name).parameter_names())
    return name, parameters


def parse_place(spec: object) -> tuple[str, dict[str, Any]] | None:
    """Place and parameters of a policy that is no registered one; None where the specification has another form.

    Args:
        spec: ``"package.module:Class"``, ``"package.module:Class:parameter=value,…"``, or a pair of the first and
            parameters. Texts that begin with the name of a registered policy are none.

    Raises:
        InvalidInputError: The parameters have another form, or one is given twice.
    """
    text, given = spec if isinstance(spec, tuple) and len(spec) == 2 else (spec, None)
    if not isinstance(text, str) or not isinstance(given, (Mapping, type(None))):
        return None
    module, _, rest = text.strip().partition(":")
    attribute, more, parameters = rest.partition(":")
    place = f"{module}:{attribute}"
    if registry.known(module) or not registry.PLACE.fullmatch(place) or (more and given is not None):
        return None
    return place, (parse_parameters(parameters, f"policy {text!r}") if more else dict(given or {}))


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
    """Parts between commas that stand in no bracket."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts
