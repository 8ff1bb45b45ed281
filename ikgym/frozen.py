"""The base of frozen dataclasses, whose fields are checked by their annotations."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import inspect
import types
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, Self

from ikgym.exceptions import InvalidInputError
from ikgym.validation import Bounds, choice, known_names, shorten

#: Called with the name and the value of a field; returns the value, checked.
Check = Callable[[str, Any], Any]
#: What counts as one in an annotation.
CHECKS = (Bounds, functools.partial, types.FunctionType)


class Frozen:
    """Base of the frozen dataclasses: changed copies by name, and arrays that stay read-only when pickled.

    A field is checked by its annotation: ``Annotated[float, Bounds(above=0.0)]`` is a number above 0, ``Annotated[X,
    check]`` the result of ``check(name, value)``, ``Literal["a", "b"]`` one of these words. Texts and fields that are
    frozen dataclasses themselves are checked for their class.
    """

    def __post_init__(self) -> None:
        for name, (check, optional) in checks_of(type(self)).items():  # type: ignore[arg-type]  # a class has a hash
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
def hints_of(kind: Any) -> dict[str, Any]:
    """The annotations of a class and its bases, with all that :data:`typing.Annotated` adds."""
    return {name: hint for base in reversed(kind.__mro__) for name, hint in _annotations(base).items()}


@functools.cache
def _annotations(kind: Any) -> dict[str, Any]:
    """The annotations of a class without those of its bases."""
    # Those of a user's class may name things that are known to type checkers alone.
    with contextlib.suppress(NameError, AttributeError):
        return inspect.get_annotations(kind, eval_str=True)
    return {}


@functools.cache
def checks_of(kind: Any) -> Mapping[str, tuple[Check, bool]]:
    """The checks of the fields of a class by name, and whether a field may be None.

    A subclass that annotates a field anew, such as for another default, keeps the check of its base.
    """
    found: dict[str, tuple[Check, bool]] = {}
    for base in reversed(kind.__mro__):
        for name, hint in _annotations(base).items():
            check, optional = _check(hint)
            if check or name in found:
                found[name] = check or found[name][0], optional
    return {f.name: found[f.name] for f in dataclasses.fields(kind) if f.init and f.name in found}


def _check(hint: Any) -> tuple[Check | None, bool]:
    """The check that an annotation names, and whether it allows None."""
    parts = list(parts_of(hint))
    given = [(kind, notes) for kind, notes in parts if kind is not type(None)]
    words = [word for kind, _ in given if typing.get_origin(kind) is Literal for word in typing.get_args(kind)]
    others = [(kind, notes) for kind, notes in given if typing.get_origin(kind) is not Literal]
    notes = [(kind, note) for kind, notes in others for note in notes if isinstance(note, CHECKS)]
    check: Check | None = None
    if notes:
        kind, note = notes[0]
        check = note.check(kind) if isinstance(note, Bounds) else note
    elif others and all(isinstance(kind, type) and issubclass(kind, (Frozen, str)) for kind, _ in others):
        check = functools.partial(check_instance, kinds=tuple(kind for kind, _ in others))
    if words:
        check = functools.partial(_one_of, words=words, otherwise=check)
    return check, len(given) < len(parts)


def parts_of(hint: Any, notes: tuple[Any, ...] = ()) -> Iterator[tuple[Any, tuple[Any, ...]]]:
    """The classes of an annotation, and what :data:`typing.Annotated` adds to each."""
    if typing.get_origin(hint) is Annotated:
        yield from parts_of(hint.__origin__, hint.__metadata__ + notes)
    elif typing.get_origin(hint) in {typing.Union, types.UnionType}:
        for part in typing.get_args(hint):
            yield from parts_of(part, notes)
    else:
        yield hint, notes


def _one_of(name: str, value: Any, words: Sequence[str], otherwise: Check | None) -> Any:
    if otherwise is not None and not isinstance(value, str):
        return otherwise(name, value)
    return choice(name, value, words)


def check_instance(name: str, value: Any, kinds: tuple[type, ...]) -> Any:
    """An object of one of these classes.

    Raises:
        InvalidInputError: It is none of them.
    """
    if not isinstance(value, kinds):
        wanted = " or ".join("a text" if kind is str else f"an object of {kind.__name__}" for kind in kinds)
        raise InvalidInputError(f"{name}: expected {wanted}, got {shorten(value)}.")
    return value


def _rebuild(cls: type[Any], fields: dict[str, Any]) -> Any:
    return cls(**fields)
