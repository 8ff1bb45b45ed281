"""The base of all commands: exit codes, and the commands that list a registry."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
import re
import shlex
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, TypeVar

import numpy as np
import tyro

from baselines.cli.parsing import Rule, parse
from baselines.workers import MOST
from ikgym.exceptions import IkgymError, UnknownNameError
from ikgym.validation import FloatArray, whole_number

#: The console command in front of all others.
CONSOLE = "ikgym"

#: The extra that installs a package.
EXTRAS = {
    **dict.fromkeys(("torch", "stable_baselines3", "sb3_contrib", "tensorboard", "rich", "optuna", "yaml"), "train"),
    **dict.fromkeys(("trimesh", "viser", "yourdfpy"), "view"),
    **{"h5py": "data", "minari": "data", "pinocchio": "urdf", "toppra": "paths", "moviepy": "video", "ray": "cluster"},
}


P = TypeVar("P")


def program(name: str, otherwise: str) -> str:
    """The name of a command behind ``ikgym``, or the other one if Python runs its module."""
    return f"{CONSOLE} {name}" if pathlib.Path(sys.argv[0]).stem == CONSOLE else otherwise


def run(work: Callable[[], int], stopped: Callable[[], str] = lambda: "Stopped.") -> int:
    """Runs a command; returns its exit code, 2 after an expected error, 130 and the message `stopped` after Ctrl-C."""
    try:
        code = work()
        sys.stdout.flush()
    except IkgymError as e:
        complain(str(e))
        return 2
    except ModuleNotFoundError as e:
        package = (e.name or "").partition(".")[0]
        if package not in EXTRAS:
            raise
        complain(f'This needs {package}: pip install "{CONSOLE}[{EXTRAS[package]}]"')
        return 2
    except KeyboardInterrupt:
        print(f"\n{stopped()}", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader, such as `head`, has closed the pipe. The rest of the buffer goes nowhere: Python would write it at
        # its end.
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code


def run_resumable(
    kind: type[P],
    arguments: Sequence[str] | None,
    prog: str,
    manual: Callable[[str], str],
    work: Callable[[P, str], None],
    rules: Iterable[Rule] = (),
) -> int:
    """Reads the options of a command that writes into the folder of ``--out``, does its work, returns the exit code.

    `workers`, `episodes` and `trials`, if there are such options, are checked. The work is called with the options and
    the whole command line.
    """
    given, out = sys.argv[1:] if arguments is None else list(arguments), None

    def both() -> int:
        nonlocal out
        options = parse(kind, given, prog=prog, description=manual(prog), rules=rules)
        out = getattr(options, "out", None)
        for name, most in (("workers", MOST), ("episodes", None), ("trials", None)):
            if (value := getattr(options, name, None)) is not None:
                whole_number(name, value, at_least=1, at_most=most)
        work(options, shlex.join([*prog.split(), *given]))
        return 0

    kept = "Stopped. Finished work is in {}; continue with --resume."
    return run(both, lambda: "Stopped." if out is None else kept.format(out))


def listing(title: str, names: Iterable[str]) -> str:
    """Names as a paragraph of a manual."""
    return textwrap.fill(f"{title}: {', '.join(names)}.", 100, subsequent_indent="  ", break_on_hyphens=False)


def complain(message: str) -> None:
    """Prints an error as one line on stderr."""
    print(f"error: {' '.join(message.split())}", file=sys.stderr)


def width() -> int:
    """Most characters of a line of output: those of the terminal, at least 80; 120 if there is none."""
    return max(80, shutil.get_terminal_size((120, 24)).columns)


@dataclasses.dataclass(frozen=True)
class Names:
    """Arguments of a list."""

    names: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="NAME …")] = ()
    """Names to show in full, or files: .urdf or .toml for arms, .toml for scenarios. The list if left out."""


N = TypeVar("N", bound=Names)


@dataclasses.dataclass(frozen=True)
class Catalogue:
    """A registry for printing."""

    kind: str  # the word for a member
    names: Callable[[], Sequence[str]]  # gives the names of all members
    head: tuple[str, ...]  # heads of the columns; the last column fills the line
    row: Callable[[str], tuple[str, ...]]  # the other cells of a member's line
    # the full description of a member; the command prints its own where there is none
    full: Callable[[str], str] | None = None
    endings: tuple[str, ...] = ()  # suffixes of files that are shown in full like members


def list_members(word: str, catalogue: Catalogue, arguments: Sequence[str]) -> int:
    """A command that prints a catalogue, or some of its members in full; see :func:`members`."""
    given = members(word, catalogue, arguments, Names)
    if given.names and catalogue.full is not None:
        print("\n\n".join(_refilled(catalogue.full(name), width()) for name in given.names))
    return 0


def members(word: str, catalogue: Catalogue, arguments: Sequence[str], kind: type[N], rules: Iterable[Rule] = ()) -> N:
    """The arguments of a command that shows members of a catalogue; prints the catalogue where none is named."""
    description = f"Lists the {word}, or shows some in full."
    given = parse(kind, arguments, prog=f"{CONSOLE} {word}", description=description, rules=rules)
    known = catalogue.names()
    for name in given.names:
        if name not in known and not name.endswith(catalogue.endings):
            raise UnknownNameError(catalogue.kind, name, known)
    if not given.names:
        print(aligned([catalogue.head, *((name, *catalogue.row(name)) for name in known)], width()))
    return given


def aligned(rows: Sequence[Sequence[str]], most: int) -> str:
    """A table of rows of cells, the head first; the last column is wrapped to fit the width in characters."""
    sizes = [max(len(row[i]) for row in rows) for i in range(len(rows[0]) - 1)]
    start = sum(sizes) + 2 * len(sizes)
    lines = []
    for row in rows:
        wrapped = textwrap.wrap(row[-1], max(most - start, 16), break_on_hyphens=False) or [""]
        cells = "  ".join(f"{cell:{size}}" for cell, size in zip(row[:-1], sizes, strict=True))
        lines += [f"{cells}  {wrapped[0]}".rstrip(), *(" " * start + line for line in wrapped[1:])]
    return "\n".join([*lines[:1], "-" * min(max(map(len, lines)), most), *lines[1:]])


def numbers(values: Sequence[float] | FloatArray) -> str:
    """Numbers as text, with four digits."""
    return ", ".join(f"{x:.4g}" for x in np.round(np.array(values), 9) + 0.0)


def _refilled(text: str, most: int) -> str:
    """A text with its paragraphs and items wrapped."""
    parts: list[str] = []
    for line in text.splitlines():
        item = re.match(r" *- | {0,4}\w+:( |$)| *\w.*?  |  \w+ = ", line)
        if not line.strip() or item or not (parts and parts[-1]):
            parts.append(line.rstrip())
        else:
            parts[-1] += f" {line.strip()}"
    return "\n".join(_filled(part, most) for part in parts)


def _filled(part: str, most: int) -> str:
    indent = len(part) - len(part.lstrip())
    hanging = indent + 2 if part.lstrip().startswith("- ") else indent + 4 if indent else 0
    return textwrap.fill(part, most, subsequent_indent=" " * hanging, break_on_hyphens=False)
