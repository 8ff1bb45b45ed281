"""Compares policies on test sets or scenarios in one table with intervals: ``ikgym leaderboard``."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Literal

import tyro

from baselines.cli import shell
from baselines.cli.commands.evaluate import RULES, Arguments
from baselines.evaluation import records
from baselines.evaluation.results import Rows, slug
from baselines.evaluation.run import carry_out
from baselines.files import write
from ikgym.exceptions import InvalidInputError

#: The test set that scores are published on.
MAIN = "varga7-pose-random"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options(Arguments):
    """Options of the command line: those of evaluate, with other defaults."""

    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")] = dataclasses.field()
    """Folder for the results, the table and the plots."""
    scenarios: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Scenarios instead of test sets: names, FILE.toml, MODULE:ATTRIBUTE, or: all."""
    test_sets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Test sets. If neither these nor scenarios are given: varga7-pose-random."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = ("all",)
    """Policies as those of evaluate. Agents in DIR/seed-N/ are training seeds of one agent and share a line, DIR."""
    timed: Annotated[int | Literal["all"], tyro.conf.arg(metavar="N|all")] = 2
    """Episodes of each policy that are played alone and timed."""
    fallback: ClassVar[Mapping[str, tuple[str, ...]]] = {"test_sets": (MAIN,)}


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
    """Writes the table and the plots into a folder; returns the table, as Markdown."""
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


def _work(given: Options, command: str) -> None:
    if given.scenarios and given.test_sets:
        raise InvalidInputError("expected --test-sets or --scenarios; got both.")
    rows = carry_out(dataclasses.replace(given, progress=True), command=command)
    print(compare(rows, given.policies, given.out))
    for one in rows.skipped:
        print(f"skipped: {one.policy} in {one.scenario}: {one.reason}")
    print(f"\nwritten to {given.out}")


main = shell.Command("leaderboard", Options, manual, _work, RULES, shell.RESUMED)
