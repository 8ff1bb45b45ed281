"""The fields of a policy as its kernel takes them: one named tuple, made from the class."""

from __future__ import annotations

import collections
import dataclasses
import functools
from typing import Any

from ikgym.frozen import hints_of

_DERIVED = "derived"
_PREFIX = "Fields__"


def derived() -> Any:
    """A field that ``__post_init__`` calculates from the parameters for the kernel: a number, an array or a tuple."""
    return dataclasses.field(init=False, repr=False, metadata={_DERIVED: True})


@functools.cache
def kernel_fields(policy: Any) -> tuple[str, ...]:
    """Names of the fields that a kernel takes: parameters of the type float, int or bool, and derived fields."""
    hints = hints_of(policy)
    numbers = {name for name, hint in hints.items() if getattr(hint, "__origin__", hint) in {float, int, bool}}
    fields = dataclasses.fields(policy)
    return tuple(f.name for f in fields if _DERIVED in f.metadata or (f.init and not f.kw_only and f.name in numbers))


@functools.cache
def named_tuple(names: tuple[str, ...]) -> type[Any]:
    """The named tuple with fields of these names.

    Its name consists of them, so that machine code on disk, which refers to it by name, belongs to these fields in this
    order, and every process finds it without the policies that use it.
    """
    name = _PREFIX + "__".join(names)
    kind: type[Any] = globals().setdefault(name, collections.namedtuple(name, names, module=__name__))
    return kind


def __getattr__(name: str) -> Any:
    if not name.startswith(_PREFIX):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return named_tuple(tuple(filter(None, name.removeprefix(_PREFIX).split("__"))))
