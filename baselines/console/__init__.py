"""The console command ``ikgym``: one word for each of the others, and lists of what there is."""

from __future__ import annotations

import dataclasses
import importlib
import sys
from collections.abc import Callable, Sequence
from typing import Annotated

import tyro

import ikgym
from baselines import command
from baselines.console import listing
from ikgym.exceptions import UnknownNameError

#: What each command does, and where it is, imported when it is asked for.
COMMANDS = {
    "evaluate": ("play policies on scenarios: table, files and plots", "baselines.evaluate"),
    "train": ("train an agent", "baselines.training.command"),
    "tune": ("search settings of solvers", "baselines.tune"),
    "dataset": ("write episodes as a data set of Minari", "baselines.dataset"),
    "reproduce": ("draw the figures of the papers again, and test their claims", "baselines.reproduce"),
    "leaderboard": ("compare agents and solvers on the test sets", "baselines.leaderboard"),
    "robustness": ("map what imperfect plants cost policies", "baselines.robustness"),
    "view": ("show policies side by side in a browser, live and in an episode", "baselines.viewer.view"),
    "video": ("write an episode as a video", "baselines.viewer.video"),
    "oracle": ("search the best known costs", "baselines.optimum"),
}

#: Lists of what there is.
LISTS = {
    "arms": ("list the arms, or show some", listing.ARMS),
    "scenarios": ("list the scenarios, or show some", listing.SCENARIOS),
    "policies": ("list the policies, or show some with their parameters", listing.POLICIES),
}


@dataclasses.dataclass(frozen=True)
class Names:
    """What a list takes."""

    names: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="NAME …")] = ()
    """What is to be shown in full: names, or files, .urdf of arms and .toml of scenarios. The list if left out."""


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        arguments: What stands behind ``ikgym``; taken from the process if left out.

    Returns:
        The exit code: that of the command; 2 where something expected went wrong, 130 after Ctrl-C.
    """
    first, *others = (sys.argv[1:] if arguments is None else list(arguments)) or ["--help"]
    return command.run(lambda: _called(first)(others))


def manual() -> str:
    """The text of ``--help``."""
    summaries = {name: summary for name, (summary, _) in [*COMMANDS.items(), *LISTS.items()]}
    lines = "\n".join(f"  {name:12} {summary}" for name, summary in summaries.items())
    return f"""\
usage: {command.CONSOLE} COMMAND …

Inverse kinematics of redundant arms: a Gymnasium environment, and a benchmark
in which every solver is a policy.

{lines}

{command.CONSOLE} COMMAND --help says more; {command.CONSOLE} --version prints the version."""


def _called(word: str) -> Callable[[Sequence[str]], int]:
    """What does the work of a command.

    Raises:
        UnknownNameError: There is no such command; the message has the nearest name.
    """
    if word in ("-h", "--help", "--version"):
        return lambda _: _say(ikgym.__version__ if word == "--version" else manual())
    if word in LISTS:
        return lambda arguments: _list(word, arguments)
    if word not in COMMANDS:
        raise UnknownNameError("command", word, [*COMMANDS, *LISTS])
    main_of_it: Callable[[Sequence[str]], int] = importlib.import_module(COMMANDS[word][1]).main
    return main_of_it


def _list(word: str, arguments: Sequence[str]) -> int:
    summary, catalogue = LISTS[word]
    options = command.parse(Names, arguments, prog=f"{command.CONSOLE} {word}", description=f"{summary.capitalize()}.")
    return _say(listing.shown(catalogue, options.names, command.width()))


def _say(text: str) -> int:
    print(text)
    return 0
