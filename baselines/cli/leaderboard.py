"""Compares policies on test sets or scenarios in one table with intervals: ``ikgym leaderboard``."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Sequence
from typing import Annotated, Literal

import tyro

from baselines.cli import shell
from baselines.evaluation import records
from baselines.evaluation.results import Rows, slug
from baselines.evaluation.run import evaluate
from baselines.files import write
from ikgym.exceptions import InvalidInputError

#: The test set that scores are published on.
MAIN = "varga7-pose-random"


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the command line."""

    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the results, the table and the plots."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = ("all",)
    """Policies as those of evaluate. Agents in DIR/seed-N/ are training seeds of one agent and share a line, DIR."""
    test_sets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Test sets. If neither these nor scenarios are given: varga7-pose-random."""
    scenarios: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Scenarios instead of test sets: names, FILE.toml, MODULE:ATTRIBUTE, or: all."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Test episodes of each random scenario; a test set has its own number."""
    timed: Annotated[int | Literal["all"], tyro.conf.arg(metavar="N|all")] = 2
    """Episodes of each policy that are played alone and timed."""
    resume: bool = False
    """Continue with the results in the folder."""
    overwrite: bool = False
    """Replace the results in the folder."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that play episodes. With more than one, times are less reliable."""
    cluster: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Play untimed episodes on a cluster: ray, at the address in RAY_ADDRESS."""


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Compares policies on test sets: geometric mean of the cost ratio with its bootstrap interval, 90th percentile, worst
episode, lost episodes and times. All options work as in evaluate.

Examples:
  {prog} --out results/leaderboard
  {prog} --policies dls qp rhc:horizon=100 agent:runs/apg/seed-*/agent.safetensors --out results/agents
  {prog} --scenarios panda-circle iiwa14-circle --policies qp pink mink --out results/rivals

Files in DIR, besides those of evaluate:
  table.csv, table.md    the table
  cost-time-SCENARIO.png, foresight.png"""


def compare(rows: Rows, policies: Sequence[str], out: pathlib.Path) -> str:
    """Writes the table and the plots.

    Args:
        rows: The results.
        policies: The policies as text.
        out: The folder.

    Returns:
        The table, as Markdown.

    Raises:
        ResultsError: The folder cannot be written.
    """
    from baselines.evaluation.plots import comparison
    from baselines.evaluation.plots.style import png

    lines = records.records(rows, policies)
    text = records.markdown(lines)
    write(out / "table.csv", records.to_csv(lines).encode())
    write(out / "table.md", f"{text}\n".encode())
    for scenario in dict.fromkeys(line["scenario"] for line in lines):
        here = [line for line in lines if line["scenario"] == scenario]
        write(out / f"cost-time-{slug(scenario)}.png", png(comparison.cost_time(here, scenario)))
    by_name = [{**line, "name": line["policy"].partition(":")[0]} for line in lines]
    write(out / "foresight.png", png(comparison.foresight(by_name, "Cost against foresight", "name")))
    return text


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        arguments: The words after the command; those of the process if left out.

    Returns:
        The exit code: 0, 2 after an expected error, 130 after Ctrl-C.
    """
    return shell.run_resumable(Options, arguments, "ikgym leaderboard", manual, _work)


def _work(options: Options, command: str) -> None:
    del command
    if options.test_sets and options.scenarios:
        raise InvalidInputError("expected --test-sets or --scenarios; got both.")
    shell.find_own_modules()
    sets = options.test_sets or (() if options.scenarios else (MAIN,))
    rows = evaluate(
        options.scenarios,
        options.policies,
        test_sets=sets,
        episodes=options.episodes,
        timed=options.timed,
        out=options.out,
        resume=options.resume,
        overwrite=options.overwrite,
        workers=options.workers,
        cluster=options.cluster,
        plots=False,
        progress=True,
    )
    print(compare(rows, options.policies, options.out))
    for one in rows.skipped:
        print(f"skipped: {one.policy} in {one.scenario}: {one.reason}")
    print(f"\nwritten to {options.out}")
