"""Evaluates policies on scenarios: costs, errors, joint velocities and times, as a table, as files and as plots.

>>> from baselines.evaluate import evaluate
>>> rows = evaluate("varga7-fast", ["dls", ("rhc_gradient", {"horizon": 5})])
>>> rows.skipped
()
"""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import pathlib
import shlex
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Literal

import tyro

from baselines import command
from baselines.evaluation import report
from baselines.evaluation.entrants import ALL, AnyPolicy, Wrap
from baselines.evaluation.export import formats
from baselines.evaluation.html import PAGE, page
from baselines.evaluation.machine import describe
from baselines.evaluation.manual import manual
from baselines.evaluation.plan import EvaluationPlan, make_plan
from baselines.evaluation.results import Results, Rows
from baselines.evaluation.runner import run
from baselines.files import write
from baselines.files.locks import locked
from baselines.workers import Workers
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview, Scenario


def evaluate(
    scenarios: str | Scenario | Iterable[str | Scenario] = (),
    policies: AnyPolicy | Iterable[AnyPolicy] = ALL,
    *,
    test_sets: str | Iterable[str] = (),
    episodes: int = 1,
    split: str = "test",
    steps: int | None = None,
    preview: Preview | None = None,
    wrap: Wrap | None = None,
    timed: int | Literal["all"] = 1,
    trust: bool = False,
    workers: int = 1,
    cluster: str | None = None,
    out: str | pathlib.Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    plots: bool = True,
    report_page: bool = True,
    export: str | Iterable[str] = (),
    noise_seeds: int = 1,
    pairs: bool = False,
    progress: bool = False,
) -> Rows:
    """Plays all policies on all scenarios, and measures them.

    Episodes of one policy in one scenario are played together, but for those that are timed. Everything but the time
    columns is the same at every run, however many are timed and whatever the number of workers. A policy that does not
    suit a scenario is left out there, and named in what is returned.

    Args:
        scenarios: Scenarios, their names, ``"file.toml"`` or ``"package.module:attribute"``; ``"all"`` stands for all
            that are registered.
        policies: Names, names with parameters such as ``"dls:damping=1e-2"``, or pairs such as
            ``("dls", {"damping": 1e-2})``; ``"agent:PATH"`` for an agent in a file; classes and instances of
            :class:`baselines.SolverPolicy`; any object or class with the `predict` of Stable-Baselines3;
            ``"package.module:Class"`` for one of those; ``"all"`` stands for all that are registered. What must be
            given an argument to be made, such as a class with ``__init__(self, scenario)``, is given the scenario.
            What is no :class:`baselines.SolverPolicy` is called for one arm at a time, and once more before the first
            step, which does not count.
        test_sets: Names of test sets, see :mod:`baselines.evaluation.test_sets`, instead of scenarios, episodes,
            split and steps.
        episodes: Episodes of a random scenario: the first of the split. A scenario that is the same at every reset
            has one, with seed 0.
        split: Where the seeds of random scenarios come from, see :data:`ikgym.scenarios.SPLITS`.
        steps: Most steps of an episode, for trials; the scenarios' own if left out.
        preview: Steps ahead that policies are shown, or which ones, such as (1, 10, 40); what each asks for by its
            attribute `preview` if left out.
        wrap: Wraps the environment for policies that are no :class:`baselines.SolverPolicy`, as an agent needs it that
            was trained on a wrapped one: ``wrap(env) -> env``. Costs and errors are those below the wrappers.
        timed: Episodes of each policy in each scenario that are played alone, with the clock; ``"all"`` for all.
        trust: Whether files of agents may run code of their own, see :class:`baselines.agents.policy.Agent`.
        workers: Processes that play episodes; 1 means this one. More than one need a main module that may be
            imported, that is with ``if __name__ == "__main__":``.
        cluster: The kind of a cluster that plays what is not timed, one of :data:`baselines.workers.CLUSTERS`; None
            for none.
        out: Where files go; nowhere if left out.
        resume: Goes on with what is in `out`.
        overwrite: Overwrites what is in `out`.
        plots: Whether to draw plots; needs `out`.
        report_page: Whether to write report.html, which shows table, plots and replays; needs `out`.
        export: What the joint motion of each episode is written as: ``"csv"``, ``"joint-trajectory"`` or both, see
            :mod:`baselines.evaluation.export`; needs `out`.
        noise_seeds: How often each episode is played, with other noise in sensors and drives, the same for all
            policies; once where there is none. Costs of an episode are put together by their geometric mean.
        pairs: Whether each scenario whose plant is not ideal is played with an ideal one, too, on the same seeds, so
            that the table can say what the plant costs each policy.
        progress: Whether to show a bar on stderr.

    Returns:
        One row an episode, policy by policy within each scenario: a list, whose `skipped` names the policies that do
        not suit a scenario.

    Raises:
        UnknownNameError: There is no such scenario, policy, parameter, split, test set, format or cluster.
        InvalidInputError: A value is out of range, a policy cannot be imported, refuses what it is shown, is shown
            nothing, cannot go to a worker or chooses no action; nothing suits any scenario; a test set has drifted or
            is to be changed; something is to be exported, and there is no `out`.
        ResultsError: `out` cannot be read or written, or is not to be gone on with; the file of an agent cannot be
            used.
        WorkerError: Workers have died over a unit again and again, or have other costs than this machine.
        ClusterError: There is no cluster.
        MissingDependencyError: The package of the cluster is not installed.
    """
    written, who = _formats(export, out), Workers(workers, cluster)
    plan = make_plan(
        scenarios,
        policies,
        test_sets=test_sets,
        episodes=episodes,
        split=split,
        steps=steps,
        preview=preview,
        wrap=wrap,
        timed=timed,
        trust=trust,
        exported=bool(written),
        noise_seeds=noise_seeds,
        pairs=pairs,
    )
    folder = None if out is None else pathlib.Path(out)
    return _carry_out(
        plan,
        workers=who,
        out=folder,
        resume=resume,
        overwrite=overwrite,
        plots=plots,
        report_page=report_page,
        export=written,
        progress=progress,
        command="baselines.evaluate.evaluate(…)",
    )


def _carry_out(
    plan: EvaluationPlan,
    *,
    workers: Workers,
    out: pathlib.Path | None,
    resume: bool,
    overwrite: bool,
    plots: bool,
    report_page: bool,
    export: Sequence[str],
    progress: bool,
    command: str,
    show: Callable[[Rows], None] | None = None,
) -> Rows:
    workers.check()
    with contextlib.nullcontext() if out is None else locked(out):
        results = None
        if out is not None:
            results = Results(out, plan, describe(), resume=resume, overwrite=overwrite, export=export)
        left = [job for job in plan.jobs if results is None or not results.done(job)]
        rows = {} if results is None else {row.key: row for row in results.rows}
        with contextlib.closing(run(left, workers=workers, progress=progress)) as batches:
            for played in batches:
                rows.update({one.job.key: one.row for one in played})
                if results is not None:
                    results.add(played)
        of_all = Rows([rows[job.key] for job in plan.jobs], plan.skipped)
        if show is not None:  # before the plots, which take a while
            show(of_all)
        if results is not None:
            _finish(results, plan, plots=plots, report_page=report_page, progress=progress, command=command)
        return of_all


def _formats(names: str | Iterable[str], out: object) -> tuple[str, ...]:
    """What is exported, checked before anything is played."""
    found = formats(names)
    if found and out is None:
        raise InvalidInputError("export: expected a folder, `out` or --out, that receives the files; got none.")
    return found


def _finish(
    results: Results, plan: EvaluationPlan, *, plots: bool, report_page: bool, progress: bool, command: str
) -> None:
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
    if report_page:
        write(results.directory / PAGE, page(results, plan.skipped, command=command, date=now))


@dataclasses.dataclass(frozen=True)
class Options:
    """What the command line takes."""

    scenarios: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Names of scenarios, FILE.toml, MODULE:ATTRIBUTE, or: all. If neither scenarios nor test sets are named:
    varga7-fast."""
    test_sets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Names of test sets, which say themselves what is played: instead of scenarios, episodes, split and steps."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = (ALL,)
    """Policies as NAME or NAME:PARAMETER=VALUE,PARAMETER=VALUE, agent:PATH for an agent in a file, MODULE:CLASS for
    one of your own, also of a module in the current folder, or: all."""
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
    """Overwrite the results in the folder."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that play episodes at the same time. They change nothing but the times, which are the truer the
    fewer processes there are."""
    cluster: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Play what is not timed on a cluster: ray, at the address in RAY_ADDRESS. What is timed is played here."""
    plots: bool = True
    """Draw plots into the folder."""
    report: bool = True
    """Write report.html into the folder: table, plots and replays in one page, which opens without a network."""
    export: Annotated[tuple[str, ...], tyro.conf.arg(metavar="FORMAT …")] = ()
    """Write the joint motion of each episode into the folder: csv for times, joint coordinates and velocities as a
    table, joint-trajectory for a message of ROS 2 as JSON, or both."""
    noise_seeds: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Play each episode so often, with other noise in sensors and drives. Episodes without noise are played once."""
    pairs: bool = False
    """Play each scenario whose plant is not ideal with an ideal one, too, and say what the plant costs each policy."""


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
        command.find_own_modules()
        written, workers = _formats(options.export, out), Workers(options.workers, options.cluster)
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
            exported=bool(written),
            noise_seeds=options.noise_seeds,
            pairs=options.pairs,
        )
        _carry_out(
            plan,
            workers=workers,
            out=options.out,
            resume=options.resume,
            overwrite=options.overwrite,
            plots=options.plots,
            report_page=options.report,
            export=written,
            progress=True,
            command=shlex.join([*_program().split(), *arguments]),
            show=lambda rows: print(report.table(rows, plan.skipped, width=command.width()), flush=True),
        )
        if out is not None:
            print(f"\nwritten to {out}" + (f"; open {out / PAGE} in a browser" if options.report else ""))
        return 0

    return command.run(
        work, lambda: "Stopped." if out is None else f"Stopped. What was finished is in {out}; go on with --resume."
    )


def _program() -> str:
    return command.program("evaluate", "python -m baselines.evaluate")


if __name__ == "__main__":
    sys.exit(main())
