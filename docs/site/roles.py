"""Docstrings as Markdown: Sphinx's roles become links, and examples at a prompt become code."""

from __future__ import annotations

import importlib.util
import itertools
import re
from collections import defaultdict
from typing import Any

import griffe

_ROLE = re.compile(r":(?:class|func|meth|mod|data|attr|exc):`~?([\w.]+)`")
_PROMPT = re.compile(r"(?:^ *(?:>>>|\.\.\.) .*(?:\n|\Z))+(?:^(?! *(?:>>>|\.\.\.)) *\S.*(?:\n|\Z))*", re.MULTILINE)

_log = griffe.get_logger(__name__)


class Roles(griffe.Extension):
    """Rewrites the docstrings of packages once they are loaded."""

    def __init__(self) -> None:
        self._paths: dict[str, list[str]] = defaultdict(list)  # of all that the packages have, by its last name

    def on_package(self, *, pkg: griffe.Module, loader: griffe.GriffeLoader, **_: Any) -> None:
        """Rewrites those of all its modules."""
        self._collect(pkg)
        self._rewrite(pkg)

    def _collect(self, thing: griffe.Object | griffe.Alias) -> None:
        self._paths[thing.name].append(thing.path)
        if isinstance(thing, griffe.Object):
            for member in thing.members.values():
                self._collect(member)

    def _rewrite(self, thing: griffe.Object) -> None:
        if thing.docstring:
            text = _PROMPT.sub(lambda found: f"```pycon\n{found[0].rstrip()}\n```\n", thing.docstring.value)
            thing.docstring.value = _ROLE.sub(lambda found: self._link(found[1], thing.path), text)
        for member in thing.members.values():
            if isinstance(member, griffe.Object):
                self._rewrite(member)

    def _link(self, target: str, scope: str) -> str:
        """A link to what is meant where the site describes it, and its name where it does not."""
        there = self._meant(target)
        if not there:
            if importlib.util.find_spec(target.partition(".")[0]) is None:
                _log.warning(f"{scope}: its docstring refers to {target!r}, which does not exist")
            return f"`{target}`"
        nearest = max(there, key=lambda path: _count_shared(path, scope))
        return f'<autoref identifier="{nearest}" optional>`{target}`</autoref>'

    def _meant(self, target: str) -> list[str]:
        """The paths that end with the target; of what a class has inherited, those of the name that it has."""
        owner, _, name = target.rpartition(".")
        exact = [path for path in self._paths[name] if f".{path}".endswith(f".{target}")]
        return exact or (self._paths[name] if owner and self._meant(owner) else [])


def _count_shared(one: str, other: str) -> int:
    """How many names two paths share from the beginning on."""
    pairs = zip(one.split("."), other.split("."), strict=False)
    return sum(1 for _ in itertools.takewhile(lambda pair: pair[0] == pair[1], pairs))
