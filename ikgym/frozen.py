"""The base of frozen dataclasses, whose fields are checked by their annotations."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any, Self

from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_names, shortened


class Frozen:
    """Base of the frozen dataclasses: changed copies by name, and arrays that stay read-only when pickled.

    Annotations may name a check, as :data:`ikgym.validation.Positive` does; its result becomes the value of the field.
    Texts and fields that are frozen dataclasses themselves are checked for their class.
    """

    def __post_init__(self) -> None:
        for name, (check, optional) in _checks(type(self)).items():  # type: ignore[arg-type]  # a class has a hash
            value = getattr(self, name)
            if value is not None or not optional:
                self._settle(**{name: check(name, value)})

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one.

        Raises:
            UnknownNameError: There is no field of that name.
            InvalidInputError: A new value is refused.
        """
        known_names(f"field of {type(self).__name__}", changes, self._fields())
        return type(self)(**{**self._fields(), **changes})

    def _settle(self, **values: Any) -> None:
        """Sets checked fields while the object is made."""
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def _fields(self) -> Mapping[str, Any]:
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.init}  # type: ignore[arg-type]

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (type(self), dict(self._fields()))


@functools.cache
def _checks(kind: Any) -> Mapping[str, tuple[Callable[[str, Any], Any], bool]]:
    """The checks of the fields of a class, named by their annotations or of a class, and whether they may be None."""
    hints = hints_of(kind)
    found: dict[str, tuple[Callable[[str, Any], Any], bool]] = {}
    for name in (field.name for field in dataclasses.fields(kind) if field.init and field.name in hints):
        hint = hints[name]
        parts = typing.get_args(hint) if typing.get_origin(hint) in (typing.Union, types.UnionType) else (hint,)
        given = [part for part in parts if part is not type(None)] or [hint]
        classes = tuple(part for part in given if isinstance(part, type) and issubclass(part, (Frozen, str)))
        if len(classes) == len(given):
            found[name] = functools.partial(_instance, kinds=classes), len(given) < len(parts)
        for check in filter(callable, getattr(given[0], "__metadata__", ())):
            found[name] = check, len(given) < len(parts)
    return found


def hints_of(kind: type[Any]) -> dict[str, Any]:
    """The annotations of a class and its bases, with all that :data:`typing.Annotated` adds."""
    hints: dict[str, Any] = {}
    for base in reversed(kind.__mro__):
        # Those of a user's class may name things that are known to type checkers alone.
        with contextlib.suppress(NameError, AttributeError):
            hints |= typing.get_type_hints(base, include_extras=True)
    return hints


def _instance(name: str, value: Any, kinds: tuple[type, ...]) -> Any:
    if not isinstance(value, kinds):
        wanted = " or ".join("a text" if kind is str else f"an object of {kind.__name__}" for kind in kinds)
        raise InvalidInputError(f"{name}: expected {wanted}, got {shortened(value)}.")
    return value


def _rebuild(cls: type[Any], fields: dict[str, Any]) -> Any:
    return cls(**fields)
