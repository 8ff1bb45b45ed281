"""The command ``ikgym evaluate``, or ``python -m baselines.evaluate``."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterable

from baselines import registry
from baselines.cli import shell
from baselines.cli.parsing import Rule
from baselines.evaluation import test_sets
from baselines.evaluation.jobs import Options
from baselines.evaluation.metrics import Row
from baselines.evaluation.run import evaluate
from ikgym import scenarios
from ikgym.scenarios import Scenario


def _scenarios(given: Options) -> tuple[str, ...]:
    """The names of scenarios; those of test sets are not among them."""
    names: tuple[str, ...] = given.scenarios or ("varga7-fast",) * (not given.test_sets)
    return names


def _find_all(given: Options) -> list[Scenario]:
    """The scenarios, those of test sets included."""
    names = scenarios.names() if "all" in given.scenarios else _scenarios(given)
    return [*map(scenarios.find, names), *(test_sets.get(name).scenario for name in given.test_sets)]


def _any(test: Callable[[Scenario], bool]) -> Callable[[Options], bool]:
    return lambda given: any(map(test, _find_all(given)))


#: Processes of this machine, or a cluster.
ONE_KIND = Rule(("--workers",), lambda given: given.cluster is None, "with --cluster")
RULES = (
    Rule(
        ("--resume", "--overwrite", "--report", "--leaderboard", "--severities"),
        lambda given: given.out is not None,
        "without --out",
    ),
    Rule(
        ("--episodes", "--split", "--steps", "--noise-seeds", "--severities"),
        lambda given: not given.test_sets,
        "with --test-sets, which define the episodes",
    ),
    Rule(
        ("--episodes", "--split"),
        _any(lambda one: one.varies),
        "on scenarios that are the same at every reset",
    ),
    Rule(("--noise-seeds",), _any(lambda one: one.plant.noisy), "on plants without noise"),
    Rule(("--pairs", "--severities"), _any(lambda one: not one.plant.ideal), "on ideal plants"),
    Rule(("--accelerations",), lambda given: bool(given.export), "without --export"),
    ONE_KIND,
    Rule(("--cluster",), lambda given: given.timed != "all", "with --timed all, since timed episodes are played here"),
)


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Plays every policy on every scenario, and measures costs, errors, joint velocities and the time per step.

{shell.listing("Scenarios", scenarios.names())}

{shell.listing("Test sets", test_sets.names())}

{shell.listing("Policies", (*registry.names(), "agent:PATH (an agent in a file)", "package.module:Class"))}

Examples:
  {prog}
  {prog} --policies dls dls:damping=1e-2 rhc_gradient:alpha_max=5e-4,horizon=5
  {prog} --scenarios varga7-random --episodes 20 --workers 4 --out results/random
  {prog} --scenarios varga7-random --episodes 50 --out results/random --resume
  {prog} --test-sets varga7-pose-random --policies rhc_gradient --out results/test
  {prog} --test-sets panda-camera --pairs --policies dls rhc told --out results/camera
  {prog} --leaderboard --test-sets varga7-pose-random --timed 2 --policies dls qp rhc:horizon=100 --out results/pose
  {prog} --scenarios panda-field --severities 0 0.5 1 --episodes 4 --policies qp rhc told --out results/map
  {prog} --scenarios varga7-random --policies agent:runs/mine.safetensors dls
  {prog} --scenarios lab.toml --policies qp --out results/lab --export csv joint-trajectory
  {prog} --scenarios lab.toml my_module:scenario --policies my_module:MyPolicy dls

Files in the folder of --out, each replaced in one go, so that a run may be stopped at any time:
  results.json  a list of rows, one an episode, written anew after each batch
  results.csv   the same as a table
  README.md     tables and conditions
  report.html   a table that sorts and filters, plots, and replays of the arms: open it in a browser
  series/       the data of the plots, as .npz
  export/       with --export, the joint motion of each episode
  table.csv, table.md, cost-time-SCENARIO.png   with --leaderboard
  map.csv, map.md, map.png                       with --severities

Columns:
{_columns()}

Where a scenario holds its reference points for several steps, costs and errors are those of the last step of each
point."""


def _columns() -> str:
    """The columns of a row, from the documentation of its class."""
    text = inspect.cleandoc(Row.__doc__ or "").partition("Args:\n")[2]
    return re.sub(r", see :\w+:`[^`]+`", "", text).replace("None", "null")


def cut_off(played: Iterable[Scenario]) -> list[str]:
    """Warnings of paths whose end is not played."""
    return [
        f"warning: {one.name}: the last {one.cut_off:.3g} s of the path are cut off, since {one.steps} steps take "
        f"{one.steps * one.dt:.4g} s; without `steps` the whole path is played."
        for one in played
        if one.cut_off
    ]


def _work(given: Options, command: str) -> None:
    for warning in cut_off(_find_all(given)) if given.steps is None else ():
        print(warning, file=sys.stderr)
    rows = evaluate(**vars(given) | {"scenarios": _scenarios(given), "progress": True, "command": command})
    from baselines.evaluation import report  # pandas is slow to import
    from baselines.evaluation.summary import summarise

    print(report.table(summarise(rows), rows.skipped, width=shell.width()))
    if given.out is not None:
        for name in ["table.md"] * given.leaderboard + ["map.md"] * bool(given.severities):
            print(f"\n{(given.out / name).read_text(encoding='utf-8')}", end="")
        print(
            f"\nwritten to {given.out}" + (f"; open {given.out / 'report.html'} in a browser" if given.report else "")
        )


main = shell.Command("evaluate", Options, manual, _work, RULES, shell.RESUMED, "baselines.evaluate")
