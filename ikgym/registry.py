"""A registry of named members, each made when first needed, and objects by their import path."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from typing import Generic, TypeVar

from ikgym.exceptions import IkgymError, InvalidInputError, UnknownNameError

Member = TypeVar("Member")

#: The form of an import path, ``package.module:attribute``.
IMPORT_PATH = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*(\.[^\W\d]\w*)*")


def check_import_path(kind: str, path: object) -> str:
    """A text in the form of an import path.

    Raises:
        InvalidInputError: It has another form; the message begins with the kind of object.
    """
    if not isinstance(path, str) or not IMPORT_PATH.fullmatch(path):
        raise InvalidInputError(f"{kind}: expected 'package.module:attribute', got {path!r}.")
    return path


def import_object(kind: str, path: str) -> object:
    """The object at an import path.

    Raises:
        InvalidInputError: The path has another form, the module cannot be imported, or has no such attribute; the
            message begins with the kind of object.
    """
    module, _, attribute = check_import_path(kind, path).partition(":")
    try:
        found: object = importlib.import_module(module)
    except Exception as e:  # whatever the code of others raises
        fault = f"{type(e).__name__}: {e}"
        raise InvalidInputError(f"{kind} {path!r}: {module} cannot be imported: {fault}.") from e
    for name in attribute.split("."):
        if not hasattr(found, name):
            public = [other for other in dir(found) if not other.startswith("_")]
            raise InvalidInputError(f"{kind} {path!r}: {UnknownNameError(f'attribute of {module}', name, public)}")
        found = getattr(found, name)
    return found


class Registry(Generic[Member]):
    """Names, and functions that make the members: their kind in messages, such as ``"arm"``, and their class."""

    def __init__(self, kind: str, member: type[Member]) -> None:
        self.kind, self._member = kind, member
        self._makers: dict[str, Callable[[], Member]] = {}
        self._unlisted: set[str] = set()
        self._made: dict[str, Member] = {}

    def register(self, name: str, make: Callable[[], Member], *, listed: bool = True) -> None:
        """Adds a member.

        Args:
            name: The new name.
            make: Called without arguments, once, when the member is first needed.
            listed: Whether :meth:`names` has it.

        Raises:
            InvalidInputError: The name is taken, or no text; or `make` cannot be called.
        """
        if not isinstance(name, str) or not name.strip():
            raise InvalidInputError(f"{self.kind}: expected a text as its name, got {name!r}.")
        if not callable(make):
            raise InvalidInputError(
                f"The {self.kind} {name!r}: expected a function without arguments that makes it, got {make!r}."
            )
        if name in self._makers:
            raise InvalidInputError(f"The {self.kind} {name!r} is registered already.")
        self._makers[name] = make
        if not listed:
            self._unlisted.add(name)

    def __contains__(self, name: object) -> bool:
        """Whether there is a member of that name, listed or not."""
        return isinstance(name, str) and name in self._makers

    def names(self) -> tuple[str, ...]:
        """All names that are listed, in the order of their registration."""
        return tuple(name for name in self._makers if name not in self._unlisted)

    def get(self, name: str) -> Member:
        """The member of a name; the same object at every call.

        Raises:
            UnknownNameError: There is no such name; the message has the nearest one.
            InvalidInputError: Its function fails, or returns something else; other members are unaffected.
        """
        if name not in self:
            raise UnknownNameError(self.kind, name, self.names())
        if name not in self._made:
            self._made[name] = self.call_maker(name, self._makers[name])
        return self._made[name]

    def call_maker(self, name: str, make: Callable[[], object]) -> Member:
        """The result of a function, which need not be registered.

        Args:
            name: Its name in messages.
            make: Called without arguments.

        Raises:
            InvalidInputError: The function fails, or returns something else.
        """
        try:
            made = make()
        except IkgymError:  # says what is wrong
            raise
        except Exception as error:  # whatever the code of others raises
            raise InvalidInputError(
                f"The {self.kind} {name!r}: making it failed: {type(error).__name__}: {error}"
            ) from error
        if not isinstance(made, self._member):
            raise InvalidInputError(
                f"The {self.kind} {name!r}: expected its maker to give an object of {self._member.__name__}, got "
                f"{made!r}."
            )
        return made
