"""Evaluates policies on scenarios: costs, errors, joint velocities and times, as a table, as files and as plots.

>>> from baselines.evaluate import evaluate
>>> rows = evaluate("varga7-fast", ["dls", ("rhc_gradient", {"horizon": 5})])
"""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import pathlib
import shlex
import sys
import textwrap
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Literal

import tyro

from baselines import command, registry
from baselines.evaluation import report
from baselines.evaluation import test_sets as known_sets
from baselines.evaluation.machine import describe
from baselines.evaluation.metrics import Row
from baselines.evaluation.plan import ALL, Plan, make_plan
from baselines.evaluation.results import Results
from baselines.evaluation.runner import run
from baselines.files import write
from baselines.spec import PolicySpec
from ikgym import scenarios as scenario_registry
from ikgym.scenarios import Scenario
from ikgym.validation import whole_number


def evaluate(
    scenarios: str | Scenario | Iterable[str | Scenario] = (),
    policies: PolicySpec | Iterable[PolicySpec] = ALL,
    *,
    test_sets: str | Iterable[str] = (),
    episodes: int = 1,
    split: str = "test",
    steps: int | None = None,
    preview: int | None = None,
    timed: int | Literal["all"] = 1,
    trust: bool = False,
    workers: int = 1,
    out: str | pathlib.Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    plots: bool = True,
    progress: bool = False,
) -> list[Row]:
    """Plays all policies on all scenarios, and measures them.

    Episodes of one policy in one scenario are played together, but for those that are timed. Everything but the time
    columns is the same at every run, however many are timed and whatever the number of workers. A policy that does not
    suit a scenario is left out there.

    Args:
        scenarios: Scenarios or their names; ``"all"`` stands for all that are registered.
        policies: Names, names with parameters such as ``"dls:damping=1e-2"``, or pairs such as
            ``("dls", {"damping": 1e-2})``; ``"agent:PATH"`` for an agent in a file; ``"all"`` stands for all that are
            registered.
        test_sets: Names of test sets, see :mod:`baselines.evaluation.test_sets`, instead of scenarios, episodes,
            split and steps.
        episodes: Episodes of a random scenario: the first of the split. A scenario that is the same at every reset
            has one, with seed 0.
        split: Where the seeds of random scenarios come from, see :data:`ikgym.scenarios.SPLITS`.
        steps: Most steps of an episode, for trials; the scenarios' own if left out.
        preview: Steps ahead that policies are shown; what each asks for if left out.
        timed: Episodes of each policy in each scenario that are played alone, with the clock; ``"all"`` for all.
        trust: Whether files of agents may run code of their own, see :class:`baselines.agents.policy.Agent`.
        workers: Processes that play episodes; 1 means this one. More than one need a main module that may be
            imported, that is with ``if __name__ == "__main__":``.
        out: Where files go; nowhere if left out.
        resume: Goes on with what is in `out`.
        overwrite: Throws away what is in `out`.
        plots: Whether to draw plots; needs `out`.
        progress: Whether to show a bar on stderr.

    Returns:
        One row an episode, policy by policy within each scenario.

    Raises:
        UnknownNameError: There is no such scenario, policy, parameter, split or test set.
        InvalidInputError: A value is out of range, a policy refuses what it is shown, or a test set has drifted or
            is to be changed.
        ResultsError: `out` cannot be read or written, or is not to be gone on with; the file of an agent cannot be
            used.
        WorkerError: A worker process has died.
    """
    plan = make_plan(
        scenarios,
        policies,
        test_sets=test_sets,
        episodes=episodes,
        split=split,
        steps=steps,
        preview=preview,
        timed=timed,
        trust=trust,
    )
    folder = None if out is None else pathlib.Path(out)
    return _carry_out(
        plan,
        workers=workers,
        out=folder,
        resume=resume,
        overwrite=overwrite,
        plots=plots,
        progress=progress,
        command="baselines.evaluate.evaluate(…)",
    )


def _carry_out(
    plan: Plan,
    *,
    workers: int,
    out: pathlib.Path | None,
    resume: bool,
    overwrite: bool,
    plots: bool,
    progress: bool,
    command: str,
    show: Callable[[list[Row]], None] | None = None,
) -> list[Row]:
    whole_number("workers", workers, at_least=1)
    results = None if out is None else Results(out, plan, describe(), resume=resume, overwrite=overwrite)
    left = [job for job in plan.jobs if results is None or not results.done(job)]
    rows = {} if results is None else {row.key: row for row in results.rows}
    with contextlib.closing(run(left, workers=workers, progress=progress)) as batches:
        for outcomes in batches:
            rows.update({job.key: row for job, row, _ in outcomes})
            if results is not None:
                results.add(outcomes)
    played = [rows[job.key] for job in plan.jobs]
    if show is not None:  # before the plots, which take a while
        show(played)
    if results is not None:
        _finish(results, plan, plots=plots, progress=progress, command=command)
    return played


def _finish(results: Results, plan: Plan, *, plots: bool, progress: bool, command: str) -> None:
    """Writes what is made from the rows."""
    pictures = {}
    if plots:
        # matplotlib is slow to import, and most evaluations from Python draw nothing.
        from baselines.evaluation.plots import draw

        pictures = draw(results, progress=progress)
    results.save()
    results.save_csv()
    now = datetime.datetime.now(datetime.UTC)
    text = report.readme(results.rows, plan.skipped, command=command, date=now, pictures=pictures)
    write(results.directory / "README.md", text.encode())


@dataclasses.dataclass(frozen=True)
class Options:
    """What the command line takes."""

    scenarios: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Names of scenarios, or: all. If neither scenarios nor test sets are named: varga7-fast."""
    test_sets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Names of test sets, which say themselves what is played: instead of scenarios, episodes, split and steps."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = (ALL,)
    """Policies as NAME or NAME:PARAMETER=VALUE,PARAMETER=VALUE, or agent:PATH for an agent in a file, or: all."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Episodes of each random scenario: the first seeds of the split. Other scenarios are the same at every reset and
    have one episode, with seed 0."""
    split: Annotated[str, tyro.conf.arg(metavar="NAME")] = "test"
    """Seeds of random scenarios: train, validation or test."""
    steps: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Most steps of an episode, for trials. The scenario's own number if left out."""
    preview: Annotated[int | None, tyro.conf.arg(metavar="P")] = None
    """Steps ahead that policies are shown. What each policy asks for if left out."""
    timed: Annotated[int | Literal["all"], tyro.conf.arg(metavar="N|all")] = 1
    """Episodes of each policy in each scenario that are played alone, with the clock. The others are played together,
    which is faster, and have no times."""
    trust: bool = False
    """Let .zip files of agents run the code in them, as Stable-Baselines3 does: only those whose maker you know."""
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for the files. Nothing is written if left out."""
    resume: bool = False
    """Go on with the results in the folder: what is done already is not done again."""
    overwrite: bool = False
    """Throw away the results in the folder."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that play episodes at the same time. They change nothing but the times, which are the truer the
    fewer processes there are."""
    plots: bool = True
    """Draw plots into the folder."""
    operations: bool = False
    """Print what a step costs in evaluations of the kinematics, factorisations and measured poses, too."""


def manual() -> str:
    """The text of ``--help`` above the options."""
    prog = _program()
    policies = (name + (" (reference)" if report.is_reference(name) else "") for name in registry.names())
    return f"""\
Plays every policy on every scenario, and measures costs, errors, joint velocities and the time per step.

{_listing("Scenarios", scenario_registry.names())}

{_listing("Test sets", known_sets.names())}

{_listing("Policies", (*policies, "agent:PATH (an agent in a file)"))}

Examples:
  {prog}
  {prog} --policies dls dls:damping=1e-2 rhc_gradient:alpha_max=5e-4,horizon=5
  {prog} --scenarios varga7-random --episodes 20 --workers 4 --out results/random
  {prog} --scenarios varga7-random --episodes 50 --out results/random --resume
  {prog} --test-sets varga7-random --policies rhc_gradient --out results/test
  {prog} --scenarios varga7-random --policies agent:runs/mine.safetensors dls

Files in the folder of --out, each replaced in one go, so that a run may be stopped at any time:
  results.json  a list of rows, one an episode, written anew after each batch
  results.csv   the same as a table
  README.md     tables, plots and conditions
  plots/        for each scenario: tracking and errors, joint velocities, joint paths, cost against time
  series/       what the plots show, as .npz

Columns:
  scenario, policy, parameters, seed, steps      which episode it is
  total_cost = tracking_cost + velocity_cost     sum of -reward
  cost_ratio                                     total_cost / best known cost, null where there is none above 1e-9
  position_error_max, position_error_rms         distance from the nominal position in [m]
  orientation_error_max, orientation_error_rms   geodesic angle in [rad], null where the task has none
  qdot_peak, qdot_rms, qdot_total_variation      of the joint velocities, in [rad/s] or [m/s]
  time_first_us                                  wall time of the first call of the policy in [µs]
  time_p50_us, time_p99_us                       that of the later calls, null where the episode was not timed
  deadline_misses                                later calls that were longer than the time step of the scenario
  status                                         the worst of the episode
  machine                                        CPU, cores and versions
  iterations, status_counts                      mean iterations in one step, and how many steps ended how
  preview                                        steps ahead that were shown, the furthest of some
  fingerprint                                    digest of the scenario and the version of the cost
  test_set                                       digest of the test set, null where there is none
  operations                                     mean kinematics, Jacobians, factorisations, measurements in a step

Costs and errors of scenarios that hold their nominal points are those of the last step of each point."""


def _listing(title: str, names: Iterable[str]) -> str:
    return textwrap.fill(f"{title}: {', '.join(names)}.", 100, subsequent_indent="  ", break_on_hyphens=False)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        arguments: What stands behind the command; taken from the process if left out.

    Returns:
        The exit code: 0, 2 where something expected went wrong, 130 after Ctrl-C.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    out: pathlib.Path | None = None

    def work() -> int:
        nonlocal out
        options = command.parse(Options, arguments, prog=_program(), description=manual())
        out = options.out
        plan = make_plan(
            options.scenarios or (() if options.test_sets else ("varga7-fast",)),
            options.policies,
            test_sets=options.test_sets,
            episodes=options.episodes,
            split=options.split,
            steps=options.steps,
            preview=options.preview,
            timed=options.timed,
            trust=options.trust,
        )
        _carry_out(
            plan,
            workers=options.workers,
            out=options.out,
            resume=options.resume,
            overwrite=options.overwrite,
            plots=options.plots,
            progress=True,
            command=shlex.join([*_program().split(), *arguments]),
            show=lambda rows: print(
                report.table(rows, plan.skipped, operations=options.operations, width=command.width()), flush=True
            ),
        )
        if out is not None:
            print(f"\nwritten to {out}")
        return 0

    return command.run(
        work, lambda: "Stopped." if out is None else f"Stopped. What was finished is in {out}; go on with --resume."
    )


def _program() -> str:
    return command.program("evaluate", "python -m baselines.evaluate")


if __name__ == "__main__":
    sys.exit(main())
