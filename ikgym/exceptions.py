"""Every error that ikgym raises on purpose, under one base class."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

import gymnasium


class IkgymError(Exception):
    """Base class of all errors raised by ikgym and its baselines."""


class InvalidInputError(IkgymError, ValueError):
    """A value does not have the shape, type, range or form that was asked for."""


class UnknownNameError(IkgymError, LookupError):
    """A name is in no registry; the message lists what there is and the nearest match."""

    def __init__(self, kind: str, name: object, available: Iterable[str]) -> None:
        self.kind, self.name, self.available = kind, name, tuple(available)
        near = difflib.get_close_matches(str(name), self.available, n=1, cutoff=0.5)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        listing = ", ".join(self.available) or "none"
        super().__init__(f"There is no {kind} {name!r}.{hint} Available: {listing}.")

    def __reduce__(self) -> tuple[type[UnknownNameError], tuple[str, object, tuple[str, ...]]]:
        return type(self), (self.kind, self.name, self.available)


class ResetNeededError(IkgymError, gymnasium.error.ResetNeeded):
    """An environment was stepped before its first reset, or after the end of its episode."""


class MissingDependencyError(IkgymError, ImportError):
    """An optional package is needed for what was asked; the message says how to install it."""
