"""Parameters of policies: the range stands beside the default, and is checked when the policy is made."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterable
from typing import Any

from ikgym.validation import known_name


def parameter(default: Any, check: Callable[..., Any], **limits: Any) -> Any:
    """A field of a policy whose value has to pass a check; where its type allows None, None does too.

    Args:
        default: The default value.
        check: Such as :func:`ikgym.validation.number`: it is given the name, the value and the limits.
        **limits: Such as ``above=0.0``.
    """
    return dataclasses.field(default=default, metadata={"check": functools.partial(check, **limits)})


def choice(name: str, value: str, available: Iterable[str]) -> str:
    """One of several words.

    Raises:
        UnknownNameError: It is none of them.
    """
    known_name(f"choice of {name}", value, available)
    return value


def checks(kind: type[Any]) -> dict[str, functools.partial[Any]]:
    """The checks of a policy's parameters by name; a subclass that changes a default keeps the check."""
    fields = [f for base in reversed(kind.__mro__) for f in vars(base).get("__dataclass_fields__", {}).values()]
    return {f.name: f.metadata["check"] for f in fields if "check" in f.metadata}


def checked(policy: Any) -> dict[str, Any]:
    """The values of a policy's parameters, checked.

    Raises:
        InvalidInputError: One is out of its range.
        UnknownNameError: One is no available choice.
    """
    optional = {f.name for f in dataclasses.fields(policy) if "None" in str(f.type)}
    given = {name: (getattr(policy, name), check) for name, check in checks(type(policy)).items()}
    return {
        name: None if value is None and name in optional else check(name, value)
        for name, (value, check) in given.items()
    }
