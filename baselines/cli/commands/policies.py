"""The command ``ikgym policies``."""

from __future__ import annotations

import dataclasses
import inspect
import re

from baselines import registry
from baselines.cli import shell


def _policy_row(name: str) -> tuple[str, ...]:
    return (summary(name) + (" Reference." if registry.get(name).reference else ""),)


def summary(name: str) -> str:
    """The first sentence about a policy."""
    return " ".join(_plain(registry.get(name).__doc__ or "").split("\n\n")[0].split())


def _policy(name: str, _: shell.Names) -> str:
    policy = registry.get(name)
    fields = policy.__dataclass_fields__
    given = [(p, fields[p].default, fields[p].default_factory) for p in policy.parameter_names()]
    parameters = [
        f"  {p} = {default!r}" if made is dataclasses.MISSING else f"  {p} = {made()!r}" for p, default, made in given
    ]
    title = f"{name}{' (reference)' if policy.reference else ''}: {policy.__module__}.{policy.__qualname__}"
    return "\n".join([title, "", _plain(inspect.getdoc(policy) or ""), "", "Defaults:", *(parameters or ["  none"])])


def _plain(text: str) -> str:
    """A docstring without the roles of Sphinx, policies by their names."""
    known = {registry.get(name).__name__: name for name in registry.names()}
    text = re.sub(r":\w+:`~?(?:[\w.]*\.)?(\w+)`", lambda m: f"`{known.get(m[1], m[1])}`", text)
    return text.replace("``", "`")


main = shell.listed("policies", "policy", registry.names, (("what it does",), _policy_row), _policy)
