"""The base of all commands: exit codes, and the commands that list a registry."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import itertools
import logging
import os
import pathlib
import re
import shlex
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Annotated, Any, Generic, TypeVar

import numpy as np
import tyro

from baselines.cli.parsing import Rule, parse
from ikgym.exceptions import IkgymError, UnknownNameError, printable
from ikgym.validation import FloatArray

#: The console command in front of all others.
CONSOLE = "ikgym"

#: The extra that installs a package.
EXTRAS = {
    **dict.fromkeys(("torch", "stable_baselines3", "sb3_contrib", "tensorboard", "rich", "optuna", "yaml"), "train"),
    **dict.fromkeys(("trimesh", "viser", "yourdfpy"), "view"),
    **{
        "h5py": "data",
        "minari": "data",
        "pinocchio": "urdf",
        "toppra": "paths",
        "scipy": "paths",
        "rosbags": "paths",
        "moviepy": "video",
        "ray": "cluster",
    },
}


#: The message after Ctrl-C of commands with ``--resume``.
RESUMED = "Finished work is in {out}; continue with --resume."

#: Fewest characters of the last column of a table, and of others that are wrapped.
LAST, NARROWEST = 16, 9

P = TypeVar("P")


def program(name: str, otherwise: str) -> str:
    """The name of a command behind ``ikgym``, or the other one if Python runs its module."""
    return f"{CONSOLE} {name}" if pathlib.Path(sys.argv[0]).stem == CONSOLE else otherwise


def run(work: Callable[[], int], stopped: Callable[[], str] = lambda: "Stopped.") -> int:
    """Runs a command; returns its exit code, 2 after an expected error, 130 and the message `stopped` after Ctrl-C."""
    with _usable_streams():
        return _exit_code(work, stopped)


def _exit_code(work: Callable[[], int], stopped: Callable[[], str]) -> int:
    try:
        try:
            code = work()
        finally:
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
        print(f"\n{printable(stopped())}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader, such as `head`, has closed the pipe
        _discard_unwritten()
        return 0
    except MemoryError as e:
        complain(f"Out of memory. {e}")
        return 2
    except OSError as e:  # such as a full disk; whoever knows more about the file has raised an IkgymError
        complain(f"{e.filename or 'Output'}: {e.strerror or e}.")
        _discard_unwritten()
        return 2
    return code


@contextlib.contextmanager
def _usable_streams() -> Iterator[None]:
    """Lets output go nowhere where a stream is closed, and escapes characters that its encoding lacks."""
    with (
        pathlib.Path(os.devnull).open("w", encoding="utf-8") as nowhere,
        contextlib.redirect_stdout(sys.stdout or nowhere),
        contextlib.redirect_stderr(sys.stderr or nowhere),
    ):
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors="backslashreplace")
        yield


def _discard_unwritten() -> None:
    """Discards what streams cannot write: Python would try again at its end."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class _Escaped:
    """A stream that escapes control characters, but not line breaks, tabs and what progress bars move the cursor by."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Writes a text; one that begins with a carriage return is a bar, and a bar has one line."""
        bar = text.startswith("\r")
        if not re.fullmatch(r"(?:\x1b\[A)+", text):
            text = "\r" * bar + printable(text[bar:], "" if bar else "\n\t")
        self._stream.write(text)
        return len(text)


@contextlib.contextmanager
def messages_once() -> Iterator[None]:
    """Drops log messages that repeat: a URDF file is read again to open its meshes."""
    seen, logger = set[str](), logging.getLogger("ikgym")

    def is_new(record: logging.LogRecord) -> bool:
        text, count = record.getMessage(), len(seen)
        seen.add(text)
        return len(seen) > count

    logger.addFilter(is_new)
    try:
        yield
    finally:
        logger.removeFilter(is_new)


@contextlib.contextmanager
def escaped_output() -> Iterator[None]:
    """Escapes control characters of names and files in all that is printed."""
    out: Any = _Escaped(sys.stdout)
    err: Any = _Escaped(sys.stderr)
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        yield


@dataclasses.dataclass(frozen=True)
class Command(Generic[P]):
    """A command: called with the words after its name, by default those of the process, it returns the exit code.

    Args:
        name: The word behind ``ikgym``.
        options: The dataclass of its options; one derived from :class:`Frozen` checks them by their annotations.
        manual: Makes the text of ``--help`` above the options, given the name of the program.
        work: Does the work, given the options and the whole command line; returns the exit code, or None for 0.
        rules: Options that have an effect only together with others.
        kept: The message after Ctrl-C, with ``{out}`` for the folder; left out where no folder is given.
        module: The module that is the same command, if Python runs it.
    """

    name: str
    options: type[P]
    manual: Callable[[str], str]
    work: Callable[[P, str], int | None]
    rules: tuple[Rule, ...] = ()
    kept: str = ""
    module: str = ""

    def __call__(self, arguments: Sequence[str] | None = None) -> int:
        """Reads the options and does the work; returns the exit code, see :func:`run`."""
        given, stopped = sys.argv[1:] if arguments is None else list(arguments), "Stopped."
        prog = program(self.name, f"python -m {self.module}" if self.module else f"{CONSOLE} {self.name}")

        def both() -> int:
            nonlocal stopped
            manual = self.manual(prog) if {"-h", "--help"} & {*given} else ""
            options = parse(self.options, given, prog=prog, description=manual, rules=self.rules)
            if self.kept and (out := getattr(options, "out", "")) is not None:
                stopped = f"Stopped. {self.kept.format(out=out)}"
            with escaped_output(), messages_once():
                return self.work(options, shlex.join([*prog.split(), *given])) or 0

        return run(both, lambda: stopped)


def listing(title: str, names: Iterable[str]) -> str:
    """Names as a paragraph of a manual."""
    return textwrap.fill(f"{title}: {', '.join(names)}.", 100, subsequent_indent="  ", break_on_hyphens=False)


def complain(message: str) -> None:
    """Prints an error as one line on stderr."""
    with contextlib.suppress(OSError):
        print(f"error: {printable(' '.join(message.split()))}", file=sys.stderr)


def width() -> int:
    """Most characters of a line of output: those of the terminal, at least 80; 120 if there is none."""
    return max(80, shutil.get_terminal_size((120, 24)).columns)


@dataclasses.dataclass(frozen=True)
class Names:
    """Arguments of a list."""

    names: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="NAME …")] = ()
    """Names to show in full, or files: .urdf or .toml for arms, .toml for scenarios. The list if left out."""


N = TypeVar("N", bound=Names)


def list_command(
    word: str,
    kind: str,
    names: Callable[[], Sequence[str]],
    row: tuple[tuple[str, ...], Callable[[str], tuple[str, ...]]],
    full: Callable[[str, N], str],
    *,
    endings: tuple[str, ...] = (),
    options: type[N] = Names,  # type: ignore[assignment]  # the default of N
    rules: tuple[Rule, ...] = (),
) -> Command[N]:
    """A command that prints a registry, or some of its members in full.

    Args:
        word: The name of the command.
        kind: The word for a member.
        names: Gives the names of all members.
        row: The heads of the columns, and the cells of a member behind its name; the last column fills the line.
        full: The full description of a member, given the arguments.
        endings: Suffixes of files that are shown in full like members.
        options: The arguments.
        rules: Options that have an effect only together with others.
    """

    def work(given: N, _: str) -> None:
        known = names()
        for name in given.names:
            if name not in known and not name.endswith(endings):
                raise UnknownNameError(kind, name, known)
        if given.names:
            print("\n\n".join(full(name, given) for name in given.names))
        else:
            print(align([(kind, *row[0]), *((name, *row[1](name)) for name in known)], width()))

    return Command(word, options, lambda _: f"Lists the {word}, or shows some in full.", work, rules)


def align(rows: Sequence[Sequence[str]], most: int) -> str:
    """A table of rows of cells, the head first, that fits the width in characters; the last column fills the line.

    Where that leaves too little to the last column, the widest of the others are wrapped, too, names at underscores.
    """
    sizes = [max(len(row[i]) for row in rows) for i in range(len(rows[0]) - 1)]
    while sizes and sum(sizes) + 2 * len(sizes) + LAST > most and max(sizes) > NARROWEST:
        sizes[sizes.index(max(sizes))] -= 1
    last = max(most - sum(sizes) - 2 * len(sizes), LAST)
    lines: list[list[str]] = []
    for row in rows:
        cells = [_wrap(cell, size) for cell, size in zip(row, (*sizes, last), strict=True)]
        lines.append([])
        for parts in itertools.zip_longest(*cells, fillvalue=""):
            lines[-1].append(
                "  ".join(f"{part:{size}}" for part, size in zip(parts, (*sizes, 0), strict=True)).rstrip()
            )
    head, *others = lines
    longest = max(len(line) for one in lines for line in one)
    return "\n".join([*head, "-" * min(longest, most), *(line for one in others for line in one)])


def _wrap(cell: str, size: int) -> list[str]:
    wrapper = textwrap.TextWrapper(size, break_on_hyphens=False)
    if len(max(cell.split(), key=len, default="")) > size:
        wrapper.wordsep_simple_re = re.compile(r"(\s+|(?<=_))")
    return wrapper.wrap(cell)


def numbers(values: Sequence[float] | FloatArray) -> str:
    """Numbers as text, with four digits."""
    return ", ".join(f"{x:.4g}" for x in np.round(np.array(values), 9) + 0.0)
