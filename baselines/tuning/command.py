"""The command line of ``ikgym tune``."""

from __future__ import annotations

import dataclasses
import pathlib
import sys
from collections.abc import Sequence
from typing import Annotated

import tyro

from baselines import command
from baselines.evaluation.report import number
from baselines.evaluation.table import grid
from baselines.files.locks import locked
from baselines.tuning.settings import EPISODES, SPLIT, Tuning
from ikgym import scenarios
from ikgym.validation import whole_number


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options:
    """What the command line takes."""

    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")]
    """A scenario: its name, FILE.toml, or MODULE:ATTRIBUTE."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = ()
    """Solvers as NAME or NAME:PARAMETER=VALUE,…; all with stated ranges that suit the scenario if left out."""
    ranges: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """More ranges, by solver and parameter; they take precedence over those that come with the solvers."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = EPISODES
    """Episodes of a trial that is not ended early: the first seeds of the split for validation."""
    budget: Annotated[int, tyro.conf.arg(metavar="N")] = 100 * EPISODES
    """Episodes that are played for each solver, over all trials and once as it is."""
    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Of what is suggested."""
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the trials, and for tuned.json."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that play trials at the same time. What several of them find depends on who is done first."""
    resume: bool = False
    """Go on with the trials in the folder."""
    overwrite: bool = False
    """Replace the trials in the folder."""


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Searches the settings of solvers with the lowest geometric mean of the total cost, by Optuna, on the first episodes of
the split "{SPLIT}". Settings that are worse than the median of those before are given up after a part of the episodes.

Examples:
  {prog} --scenario varga7-random --policies dls rhc:horizon=3 --out results/tune
  {prog} --scenario varga7-random --out results/tune --workers 4 --resume

Files:
  DIR/study.journal   all trials, for Optuna (JournalStorage), and for --resume
  DIR/tuned.json      the best settings, in the format of baselines/data/tuned"""


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        arguments: What stands behind the command; taken from the process if left out.

    Returns:
        The exit code: 0, 2 where something expected went wrong, 130 after Ctrl-C.
    """
    return command.run_resumable(Options, arguments, _program(), manual, _work)


def _work(options: Options, text: str) -> None:
    print(searched(options, text))
    print(f"\nwritten to {options.out}")


def searched(options: Options, text: str) -> str:
    """Searches, writes what was found, and returns it as a table.

    Args:
        options: What is asked for.
        text: The command, as it is written down.

    Raises:
        IkgymError: Something expected went wrong.
    """
    # Only who searches needs Optuna, and nobody who asks for help.
    from baselines.tuning.solvers import planned, result, stated
    from baselines.tuning.study import prepare, search

    whole_number("seed", options.seed, at_least=0)
    scenario = scenarios.find(options.scenario)
    studies = planned(
        scenario,
        options.policies,
        stated(options.ranges),
        episodes=options.episodes,
        budget=options.budget,
        seed=options.seed,
    )
    with locked(options.out):
        prepare(options.out, studies, resume=options.resume, overwrite=options.overwrite)
        search(options.out, studies, workers=options.workers, unit="episode", progress=True)
        found = result(options.out, studies, scenario, text)
        found.save(options.out / "tuned.json")
    return shown(found)


def shown(found: Tuning) -> str:
    """What was found, as a table."""
    lines = [
        [
            one.spec,
            *map(number, (one.default, one.tuned, one.tuned / one.default)),
            f"{one.tried}",
            str(dict(one.settings)),
        ]
        for one in found.solvers
    ]
    return grid(["solver", "as it is", "tuned", "ratio", "tried", "settings"], lines, text=(0, 5))


def _program() -> str:
    return command.program("tune", "python -m baselines.tuning.command")


if __name__ == "__main__":
    sys.exit(main())
