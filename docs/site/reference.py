"""The reference of the API and of the commands, generated from the code each time that the site is built."""

from __future__ import annotations

import importlib
import inspect
from types import ModuleType
from typing import Any

from baselines import cli
from baselines.training.options import METHODS
from docs.terminal import manual_of

_PARTS = "arms obstacles tasks trajectories trajectories.paths scenarios problems kernels.rotations exceptions sb3"
#: Modules on each page of the reference; those with names show these alone.
PAGES = {
    "ikgym": ("ikgym", *(f"ikgym.{part}" for part in _PARTS.split())),
    "baselines": (
        *("baselines", "baselines.evaluate:evaluate", "baselines.evaluation.tracking:Tracking"),
        *("baselines.evaluation.metrics:Row", "baselines.policy", "baselines.wrapper", "baselines.controller"),
        *("baselines.oracle", "baselines.papers", "baselines.papers.paper:Paper,PaperFigure,Claim,Finding"),
    ),
}


def public_names(module: ModuleType) -> list[str]:
    """Its classes and functions: those of ``__all__``, or those that it defines.

    A class is described once.
    """
    names = getattr(module, "__all__", None) or [n for n, x in vars(module).items() if _of(x) == module.__name__]
    return [name for name in names if not name.startswith("_") and _describe(getattr(module, name))]


def _of(thing: Any) -> str | None:
    return getattr(thing, "__module__", None) if _describe(thing) else None


def _describe(thing: Any) -> bool:
    """Classes, functions, and kernels, which numba has wrapped."""
    return inspect.isclass(thing) or inspect.isfunction(thing) or hasattr(thing, "py_func")


def api(page: str) -> str:
    """A page of the API, for mkdocstrings to fill."""
    parts, seen = [f"# {page}\n"], set[Any]()
    for entry in PAGES[page]:
        name, _, chosen = entry.partition(":")
        module = importlib.import_module(name)
        said = (inspect.getdoc(module) or "").split("\n\n")[0]
        parts.append(f"## {name} {{: #module-{name} }}\n\n{said}\n" if name != page else f"{said}\n")
        for public in chosen.split(",") if chosen else public_names(module):
            if getattr(module, public) not in seen:
                seen.add(getattr(module, public))
                parts.append(f"::: {name}.{public}\n    options: {{heading_level: 3}}\n")
    return "\n".join(parts)


def commands() -> str:
    """The page of the commands: what ``--help`` prints of each."""
    parts = ["# Commands\n", "What `--help` prints.\n", f"```text\n{manual_of()}\n```\n"]
    methods = [("train", method) for method in METHODS]
    for words in [*((word,) for word in cli.COMMANDS), *methods]:
        parts += [f"## ikgym {' '.join(words)}\n", f"```text\n{manual_of(*words)}\n```\n"]
    return "\n".join(parts)
