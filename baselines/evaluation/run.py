"""The evaluation as a whole: jobs are planned, played and scored, and files are written."""

from __future__ import annotations

import contextlib
import datetime
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from tqdm import tqdm
from tqdm.contrib.logging import logging_redirect_tqdm

from baselines.evaluation.jobs import Job, Options, plan
from baselines.evaluation.metrics import describe
from baselines.evaluation.play import Batch, play, play_elsewhere, split
from baselines.evaluation.play import Results as PlayedJobs
from baselines.evaluation.policies import ALL, AnyPolicy
from baselines.evaluation.results import PAGE, Results, Rows
from baselines.files import locked, write
from baselines.workers import Workers
from ikgym.kernels.compilation import logger
from ikgym.scenarios import Scenario


def evaluate(
    scenarios: str | Scenario | Iterable[str | Scenario] = (),
    policies: AnyPolicy | Iterable[AnyPolicy] = ALL,
    **options: Any,
) -> Rows:
    """Plays all policies on all scenarios, and measures them.

    Untimed episodes of one policy in one scenario are played together. Everything but the time columns is the same in
    each run, however many episodes are timed and whatever the number of workers. A policy that does not suit a
    scenario is skipped there, and listed in the result.

    Args:
        scenarios: Scenarios, their names, ``"file.toml"`` or ``"package.module:attribute"``; ``"all"`` stands for all
            registered scenarios.
        policies: Names, names with parameters such as ``"dls:damping=1e-2"``, or pairs such as
            ``("dls", {"damping": 1e-2})``; ``"agent:PATH"`` for an agent in a file; classes and instances of
            :class:`baselines.SolverPolicy`; any object or class with the `predict` of Stable-Baselines3;
            ``"package.module:Class"`` for one of those; ``"all"`` stands for all registered policies. A class or
            function that requires an argument receives the scenario. A policy that is no
            :class:`baselines.SolverPolicy` is called for one arm at a time, and once more before the first step, which
            does not count.
        **options: Fields of :class:`baselines.evaluation.jobs.Options`: test_sets, episodes, split, steps, preview,
            wrap, timed, workers, cluster, out, resume, overwrite, report, export, noise_seeds, pairs, leaderboard,
            severities, progress.
            More than one of `workers` needs a main module that may be imported, that is with
            ``if __name__ == "__main__":``.

    Returns:
        One row an episode, policy by policy within each scenario: a list, whose `skipped` lists the policies that do
        not suit a scenario.

    Raises:
        TypeError: There is no such option.
        UnknownNameError: There is no such scenario, policy, parameter, split, test set, format or cluster.
        InvalidInputError: A value is out of range; a policy cannot be imported, refuses the observation, states no
            preview, cannot be sent to a worker or chooses an invalid action; no policy suits any scenario; a test set
            has drifted or is given with options that it defines.
        ResultsError: `out` cannot be read or written, or its results cannot be continued; the file of an agent cannot
            be used.
        WorkerError: Workers died repeatedly over one batch, or have another version of the code.
        ClusterError: There is no cluster.
        MissingDependencyError: The package of the cluster is not installed.
    """
    return carry_out(Options(scenarios=scenarios, policies=policies, **options))


def carry_out(
    options: Options, *, command: str = "baselines.evaluate.evaluate(…)", show: Callable[[Rows], None] | None = None
) -> Rows:
    """See :func:`evaluate`. The files state the command; `show` is called with the rows before the report."""
    jobs, skipped = plan(options)
    workers = Workers(options.workers, options.cluster)
    workers.check()
    with contextlib.nullcontext() if options.out is None else locked(options.out):
        results = None if options.out is None else Results(options.out, jobs, describe(), options)
        left = [job for job in jobs if results is None or not results.done(job)]
        rows = {} if results is None else {row.key: row for row in results.rows}
        away, here = split(left, workers)
        with _progress(left, shown=options.progress) as (bar, announce):

            def keep(batch: Batch, played: PlayedJobs) -> None:
                rows.update({row.key: row for row, _ in played})
                if results is not None:
                    results.add(batch, played)

            with contextlib.closing(play_elsewhere(away, workers)) as all_played:
                for batch, played in all_played:
                    announce(batch)
                    bar.update(sum(job.scenario.steps for job in batch))
                    keep(batch, played)
            for batch in here:
                announce(batch)
                keep(batch, play(batch, bar.update))
        if results is not None:
            skipped += results.not_exported
        out = Rows([rows[job.key] for job in jobs], skipped)
        if show is not None:
            show(out)
        if results is not None:
            _finish(results, out, jobs, options, command)
        return out


@contextlib.contextmanager
def _progress(jobs: Sequence[Job], *, shown: bool) -> Iterator[tuple[Any, Callable[[Batch], None]]]:
    """A progress bar on stderr that counts steps, and a function that names the batch which is played."""
    bar = tqdm(
        total=sum(job.scenario.steps for job in jobs),
        disable=not shown or not jobs,
        file=sys.stderr,
        unit="step",
        unit_scale=True,
        dynamic_ncols=True,
        # A log file has no cursor to go back with.
        mininterval=0.1 if sys.stderr.isatty() else 10.0,
    )
    done = 0

    def announce(batch: Batch) -> None:
        nonlocal done
        done += len(batch)
        bar.set_description(f"{batch[0].scenario.name} · {batch[0].policy} ({done}/{len(jobs)})", refresh=False)

    # Messages, such as those on compilation, stand above the bar.
    with bar, contextlib.nullcontext() if bar.disable else logging_redirect_tqdm([logger]):
        yield bar, announce


def _finish(results: Results, rows: Rows, jobs: Sequence[Job], options: Options, command: str) -> None:
    """Writes tables and the report."""
    from baselines.evaluation import report  # pandas is slow to import, and not needed before
    from baselines.evaluation.summary import summarise

    results.save()
    results.save_csv()
    now, lines = datetime.datetime.now(datetime.UTC), summarise(results.rows)
    text = report.readme(lines, rows.skipped, command=command, date=now)
    write(results.directory / "README.md", text.encode())
    if options.report:
        from baselines.evaluation.html.page import page

        write(results.directory / PAGE, page(results, lines, rows.skipped, command=command, date=now))
    if options.leaderboard or options.severities:
        from baselines.evaluation.rankings import write_map, write_ranking

        given = options.policies if isinstance(options.policies, (list, tuple)) else [options.policies]
        names = [policy for policy in given if isinstance(policy, str)]
        if options.leaderboard:
            write_ranking(results.directory, rows, names)
        if options.severities:
            write_map(results.directory, rows, jobs, names)
