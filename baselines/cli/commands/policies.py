"""The command ``ikgym policies``."""

from __future__ import annotations

import dataclasses
import inspect
import re
import typing

from baselines import registry
from baselines.cli import shell
from ikgym.frozen import hints_of, parts_of
from ikgym.validation import Bounds


def _policy_row(name: str) -> tuple[str, ...]:
    return (summary(name) + (" Reference." if registry.get(name).reference else ""),)


def summary(name: str) -> str:
    """The first sentence about a policy."""
    return " ".join(_plain(registry.get(name).__doc__ or "").split("\n\n")[0].split())


def _policy(name: str, _: shell.Names) -> str:
    policy = registry.get(name)
    fields, hints = policy.__dataclass_fields__, hints_of(policy)
    parameters = [f"  {p} = {_default(fields[p])!r}{_limits(hints.get(p))}" for p in policy.parameter_names()]
    title = f"{name}{' (reference)' if policy.reference else ''}: {policy.__module__}.{policy.__qualname__}"
    return "\n".join([title, "", _plain(inspect.getdoc(policy) or ""), "", "Defaults:", *(parameters or ["  none"])])


def _default(field: dataclasses.Field[object]) -> object:
    return field.default if field.default_factory is dataclasses.MISSING else field.default_factory()


def _limits(hint: object) -> str:
    """The bounds of a parameter, or the words that it can be."""
    for kind, notes in parts_of(hint):
        for note in notes:
            if isinstance(note, Bounds) and str(note):
                return f", {note}"
        if typing.get_origin(kind) is typing.Literal:
            return f", one of {', '.join(typing.get_args(kind))}"
    return ""


def _plain(text: str) -> str:
    """A docstring without the roles of Sphinx, policies by their names."""
    known = {registry.get(name).__name__: name for name in registry.names()}
    text = re.sub(r":\w+:`~?(?:[\w.]*\.)?(\w+)`", lambda m: f"`{known.get(m[1], m[1])}`", text)
    return text.replace("``", "`")


main = shell.list_command("policies", "policy", registry.names, (("what it does",), _policy_row), _policy)
