"""The errors of ikgym, under one base class."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence

import gymnasium

#: Characters of a name that messages show at most.
SHOWN = 200
#: Of more names than that, messages list the first ones.
MANY, FIRST = 200, 20


class IkgymError(Exception):
    """Base class of all errors raised by ikgym and its baselines."""


class InvalidInputError(IkgymError, ValueError):
    """A value has a wrong shape, type, range or form."""


def printable(text: str, kept: str = "") -> str:
    """A text as a terminal may show it: control and format characters as escape sequences, except those in `kept`."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in kept else c.encode("unicode_escape").decode() for c in text)


def list_names(names: Sequence[str]) -> str:
    """Names for a message; of a great many, the first ones."""
    if len(names) <= MANY:
        return ", ".join(names)
    return f"{', '.join(names[:FIRST])}, … ({len(names)} in all)"


class UnknownNameError(IkgymError, LookupError):
    """A name is in no registry; the message lists the available names and the nearest match."""

    def __init__(self, kind: str, name: object, available: Iterable[str]) -> None:
        self.kind, self.name, self.available = kind, name, tuple(available)
        near = _nearest(name, self.available) if isinstance(name, str) else ()
        hint = f" Did you mean {near[0]!r}?" if near else ""
        listing = list_names(self.available) or "none"
        shown = " ".join(repr(name).split())  # arrays take several lines
        shown = shown if len(shown) <= SHOWN else f"{shown[: SHOWN - 1]}…"
        noun, *owner = re.split(r"(?= (?:of|in) )", kind, maxsplit=1)
        super().__init__(f"There is no {noun} {shown}{''.join(owner)}.{hint} Available: {listing}.")

    def __reduce__(self) -> tuple[type[UnknownNameError], tuple[str, object, tuple[str, ...]]]:
        return type(self), (self.kind, self.name, self.available)


def _nearest(name: str, available: Sequence[str]) -> Sequence[str]:
    """The name that is nearest, capital letters aside where none is near with them; empty if none is near."""
    small = {other.lower(): other for other in available}
    return difflib.get_close_matches(name, available, n=1, cutoff=0.5) or [
        small[other] for other in difflib.get_close_matches(name.lower(), small, n=1, cutoff=0.5)
    ]


class UnexpectedArgumentError(IkgymError, TypeError):
    """A keyword that an environment does not take, as Python calls it: TorchRL tries keywords until none is refused."""


class NoAttributeError(IkgymError, AttributeError):
    """A row of a vector environment has no such attribute."""


class ResetNeededError(IkgymError, gymnasium.error.ResetNeeded):
    """An environment was stepped before its first reset, or after the end of its episode."""


class MissingDependencyError(IkgymError, ImportError):
    """An optional package is needed; the message says how to install it."""
