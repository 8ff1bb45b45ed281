"""What all commands share: their names, reading their arguments, and how they end."""

from __future__ import annotations

import contextlib
import io
import os
import pathlib
import re
import shlex
import shutil
import sys
from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

import tyro

from ikgym.exceptions import IkgymError
from ikgym.validation import whole_number

#: The console command in front of all others.
CONSOLE = "ikgym"

#: Patterns in messages of tyro, and what is written for them.
PLAINER = (
    (r"no type matching (?:\{None\}\|)?(\S+) could be instantiated from \['(.*?)'\].*", r"expected \1, got '\2'"),
    (r"invalid literal for int\(\) with base 10: ", "expected a whole number, got "),
    (r"could not convert string to float: ", "expected a number, got "),
    (r"Expected 1 values", "Expected one"),
    (r" Arguments are applied to the directly preceding subcommand.*", ""),
    (r"(Missing from .*?: --\S+).*", r"\1"),
)

#: Which extra brings a package.
EXTRAS = {
    "torch": "train",
    "stable_baselines3": "train",
    "tensorboard": "train",
    "rich": "train",
    "optuna": "train",
    "h5py": "data",
    "minari": "data",
    "pinocchio": "urdf",
    "moviepy": "video",
    "ray": "cluster",
    "trimesh": "view",
    "viser": "view",
    "yourdfpy": "view",
}


class Fills(Protocol):
    """The options of a command that fills a folder, and goes on there with ``--resume``."""

    @property
    def out(self) -> pathlib.Path | None: ...  # noqa: D102


T = TypeVar("T")
P = TypeVar("P", bound=Fills)


def program(name: str, otherwise: str) -> str:
    """What a command is called in this process.

    Args:
        name: Its name behind ``ikgym``.
        otherwise: What it is called where Python has run its module, such as ``"python -m baselines.evaluate"``.
    """
    return f"{CONSOLE} {name}" if pathlib.Path(sys.argv[0]).stem == CONSOLE else otherwise


def parse(kind: type[T], arguments: Sequence[str], *, prog: str, description: str) -> T:
    """Reads what stands behind a command; a mistake becomes one line on stderr.

    Args:
        kind: What :func:`tyro.cli` fills.
        arguments: What is to be read.
        prog: The name of the command.
        description: The text of ``--help`` above the options.

    Raises:
        SystemExit: With 0 after ``--help``, with 2 after a mistake.
    """
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(kind, prog=prog, description=description, args=list(arguments))
    except SystemExit as e:
        if e.code:
            complain(f"{_in_one_line(said.getvalue())} See {prog} --help.")
        raise


def run(work: Callable[[], int], stopped: Callable[[], str] = lambda: "Stopped.") -> int:
    """Does the work of a command.

    Args:
        work: Gives the exit code.
        stopped: What is said after Ctrl-C.

    Returns:
        The exit code: that of the work, 2 where something expected went wrong, 130 after Ctrl-C.
    """
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
        # The reader, such as `head`, has seen enough. What is left in the buffer goes nowhere, or Python would try to
        # write it once more when it ends.
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
) -> int:
    """Reads the options of a command that fills the folder of ``--out``, and does its work.

    Args:
        kind: Of the options; `workers` and `episodes`, where there are such, must be at least 1.
        arguments: What stands behind the command; taken from the process if left out.
        prog: The name of the command.
        manual: Gives the text of ``--help`` above the options for that name.
        work: Is handed the options and the whole command line.

    Returns:
        The exit code, see :func:`run`.
    """
    given = sys.argv[1:] if arguments is None else list(arguments)
    out = "the folder of --out"

    def both() -> int:
        nonlocal out
        options = parse(kind, given, prog=prog, description=manual(prog))
        out = str(options.out)
        for name in ("workers", "episodes"):
            if (value := getattr(options, name, None)) is not None:
                whole_number(name, value, at_least=1)
        work(options, shlex.join([*prog.split(), *given]))
        return 0

    return run(both, lambda: f"Stopped. What was finished is in {out}; go on with --resume.")


def find_own_modules() -> None:
    """Lets modules in the current folder be imported, where a console command does not look."""
    if (here := str(pathlib.Path.cwd())) not in sys.path:
        sys.path.append(here)


def complain(message: str) -> None:
    """Prints what went wrong as one line on stderr."""
    print(f"error: {' '.join(message.split())}", file=sys.stderr)


def width() -> int:
    """Characters that a line of output may have: those of the terminal, 80 at least, 120 where there is none."""
    return max(80, shutil.get_terminal_size((120, 24)).columns)


def _in_one_line(box: str) -> str:
    """The message in a box of tyro's: what is wrong, and what there is instead."""
    sections: list[list[str]] = [[]]
    for line in re.sub(r"\x1b\[[0-9;]*m", "", box).splitlines():
        row = line.strip("│ ")
        if not row.strip("─-"):
            sections.append([])
        elif not row.startswith(("╭", "╰")):
            sections[-1].append(row)
    # Where nothing but ASCII can be printed there is no frame that holds the title: it is a section.
    texts = [" ".join(section) for section in sections if section][0 if "╭" in box else 1 :]
    message, more = (*texts, "", "")[:2]
    for pattern, plain in PLAINER:
        message = re.sub(pattern, plain, message)
    if listed := re.match(r"Available subcommands: ([\w, -]+)", more):
        message += f". Available: {listed[1].strip()}"
    if near := re.match(r"Perhaps you meant:? (\S+)", more):
        message += f". Did you mean {near[1]!r}?"
    return message if message.endswith(("?", ".")) else f"{message}."
