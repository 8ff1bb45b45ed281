"""The command ``ikgym``: one module a command, imported when the command line names it."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence

from baselines.cli import shell
from ikgym.exceptions import InvalidInputError, UnknownNameError

#: A summary of each command; its module in :mod:`baselines.cli.commands` has its name, and a function ``main``.
COMMANDS = {
    "evaluate": "play policies on scenarios: table, files and plots",
    "path": "say whether a path can be driven, from which start, how fast",
    "identify": "find the drives of an arm in a log of its motion",
    "compare": "recommend a solver for an arm and a path",
    "train": "train an agent",
    "tune": "search settings of solvers",
    "dataset": "write episodes as a Minari data set",
    "reproduce": "draw the figures of the papers again, and test their claims",
    "view": "show policies side by side in a browser, live and in an episode",
    "video": "write an episode as a video",
    "oracle": "search best known costs",
    "arms": "list the arms, or show some",
    "scenarios": "list the scenarios, or show some",
    "policies": "list the policies, or show some with their parameters",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line, by default the process's; returns the exit code, see :func:`baselines.cli.shell.run`."""
    first, *others = (sys.argv[1:] if arguments is None else list(arguments)) or ["--help"]
    return shell.run(lambda: _command(first)(others))


def manual() -> str:
    """The text of ``--help``."""
    lines = "\n".join(f"  {name:12} {summary}" for name, summary in COMMANDS.items())
    return f"""\
usage: {shell.CONSOLE} COMMAND …

Inverse kinematics of redundant arms: a Gymnasium environment, and a benchmark
in which every solver is a policy.

{lines}

{shell.CONSOLE} COMMAND --help says more; {shell.CONSOLE} --version prints the version."""


def _command(word: str) -> Callable[[Sequence[str]], int]:
    """The function of a command."""
    if word in ("-h", "--help", "--version"):
        return lambda others: _print_about(word, others)
    if word not in COMMANDS:
        raise UnknownNameError("command", word, COMMANDS)
    function: Callable[[Sequence[str]], int] = importlib.import_module(f"baselines.cli.commands.{word}").main
    return function


def _print_about(word: str, others: Sequence[str]) -> int:
    import ikgym

    if others:
        raise InvalidInputError(f"{word}: expected nothing after it, got {' '.join(others)}.")
    print(ikgym.__version__ if word == "--version" else manual())
    return 0
