"""An evaluation: jobs are planned, played in batches and scored, and files are written."""

from __future__ import annotations

import contextlib
import datetime
import functools
import itertools
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from threadpoolctl import threadpool_limits
from tqdm import tqdm
from tqdm.contrib.logging import logging_redirect_tqdm

import ikgym
from baselines.episodes import Episode, Tick, rollouts
from baselines.evaluation.jobs import Job, Options, plan
from baselines.evaluation.metrics import Row, Rows, Skipped, describe, measure
from baselines.evaluation.policies import ALL, AnyPolicy, check_picklable
from baselines.files import canonical, jsonable, locked
from baselines.fingerprints import fingerprint
from baselines.oracle import best_known
from baselines.oracle.stripped import ideal
from baselines.policy import SolverPolicy
from ikgym.exceptions import printable
from ikgym.kernels.jit import logger
from ikgym.scenarios import Scenario
from ikgym.scenarios.preview import furthest

if TYPE_CHECKING:
    import pandas as pd

    from baselines.evaluation.results import Results
    from baselines.workers import Workers

#: Most episodes that are played together: their records are in memory until all of them are finished.
MOST = 64
#: The same on a cluster, where small batches are spread better, and cost less if a node is lost.
BLOCK = 8

#: Jobs of one policy in one scenario that are played together.
Batch = tuple[Job, ...]
#: The row of each job of a batch, and the record of the episode if the job needs it.
Played = list[tuple[Row, Episode | None]]


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
        scenarios: Scenarios, their names, ``"file.toml"`` or ``"package.module:attribute"``; ``"all"`` means all
            registered scenarios.
        policies: Names, names with parameters such as ``"dls:damping=1e-2"``, or pairs such as
            ``("dls", {"damping": 1e-2})``; ``"agent:PATH"`` for an agent in a file; classes and instances of
            :class:`baselines.SolverPolicy`; any object or class with the `predict` of Stable-Baselines3;
            ``"package.module:Class"`` for one of those; ``"all"`` means all registered policies. A class or
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
    options: Options,
    *,
    command: str = "baselines.evaluate.evaluate(…)",
    show: Callable[[pd.DataFrame, Sequence[Skipped]], None] | None = None,
) -> Rows:
    """See :func:`evaluate`. The files state the command; `show` is called with the lines of the table and `skipped`."""
    jobs, skipped = plan(options)
    workers, results = None, None
    if (options.workers, options.cluster) != (1, None):
        from baselines.workers import Workers

        workers = Workers(options.workers, options.cluster)
        workers.check()
    with contextlib.nullcontext() if options.out is None else locked(options.out):
        if options.out is not None:
            from baselines.evaluation.results import Results

            results = Results(options.out, jobs, describe(), options)
        rows = {row.key: row for row in results.rows} if results else {}
        left = [job for job in jobs if not (results and results.is_done(job))]
        with _progress(left, shown=options.progress) as bar:
            for batch, played in _play_all(left, workers, bar):
                rows |= {row.key: row for row, _ in played}
                if results:
                    results.add(batch, played)
        out = Rows([rows[job.key] for job in jobs], [*skipped, *(results.not_exported if results else [])])
        if results:
            results.save()
        if show or results:
            from baselines.evaluation.summary import summarise  # pandas is slow to import

            lines = summarise(out)
            if show:
                show(lines, out.skipped)
            if results:
                if len(results.rows) > len(out):  # the folder has others, too
                    lines = summarise(results.rows)
                _write_tables(results, lines, out, jobs, options, command)
        return out


def play(batch: Batch, tick: Tick | None = None) -> Played:
    """Plays jobs of one policy in one scenario together; a timed one has to be alone.

    Raises:
        InvalidInputError: The policy refuses the observation, or chooses an invalid action.
    """
    first = batch[0]
    scenario, policy = first.scenario, first.bind()
    # Of an arm that plays several episodes one after the other, those before a job's are played, too.
    in_a_row = 1 + max(job.before for job in batch)
    starts = dict.fromkeys(job.seeds._replace(seed=job.seeds.seed - job.before) for job in batch)
    seeds = [start._replace(seed=start.seed + k) for start in starts for k in range(in_a_row)]
    options: dict[str, Any] = {"preview": first.preview, "timed": first.timed, "tick": tick}
    if first.specification.wrap is not None and not isinstance(policy, SolverPolicy):
        from baselines.evaluation.foreign import WrappedEnvironment

        options["begin"] = functools.partial(WrappedEnvironment, policy)
    # The matrices of one arm are too small to share out, and threads would blur the times. Environment variables
    # affect only libraries that are not loaded yet.
    with threadpool_limits(limits=1):
        if in_a_row == 1 and getattr(policy, "free_timing", False):
            from baselines.evaluation.motion.free_timing import play_to_end

            episodes = play_to_end(scenario, policy, seeds, **options)
        else:
            episodes = rollouts(scenario, policy, seeds, in_a_row=in_a_row, **options)
    played = dict(zip(seeds, episodes, strict=True))
    about: dict[str, Any] = {"machine": describe(), "preview": furthest(first.preview), "test_set": first.test_set}
    about |= {"fingerprint": first.fingerprint, "ideal": fingerprint(ideal(scenario))}
    out: Played = []
    for job in batch:
        episode, best = played[job.seeds], best_known.cost(scenario, job.seeds.seed, job.seeds.arm_seed)
        row = measure(scenario, job.policy, job.parameters, episode, best_known=best, **about)
        out.append((row, episode if job.record else None))
    return out


def batches(jobs: Iterable[Job], most: int = MOST) -> list[Batch]:
    """Jobs that are played together, in their order: timed ones and those of a policy for one episode alone."""

    def alike(job: Job) -> tuple[object, ...]:
        return job.scenario.name, job.policy, canonical(job.parameters), canonical(jsonable(job.arguments)), job.timed

    out: list[Batch] = []
    for _, group in itertools.groupby(jobs, alike):
        same = tuple(group)
        size = 1 if same[0].timed else most
        out += [same[first : first + size] for first in range(0, len(same), size)]
    return out


def _play_all(jobs: Sequence[Job], workers: Workers | None, bar: _Bar) -> Generator[tuple[Batch, Played], None, None]:
    """Plays all jobs, by workers where there are some, and yields each batch as soon as it is finished.

    On a cluster nothing is timed: timed jobs are played here, after the others.
    """
    away, here = list[Batch](), batches(jobs)
    if workers is not None and workers.cluster is not None:
        away = batches((job for job in jobs if not job.timed), BLOCK)
        here = batches(job for job in jobs if job.timed)
    elif workers is not None and len(here) > 1:
        away, here = here, away
    if workers is not None and away:
        yield from _play_away(away, workers, bar)
    for batch in here:
        bar.announce(batch)
        yield batch, play(batch, bar.update)


def _play_away(away: Sequence[Batch], workers: Workers, bar: _Bar) -> Generator[tuple[Batch, Played], None, None]:
    """Plays batches by workers."""
    from baselines.workers import WorkerError, run_units

    check_picklable({batch[0].specification: None for batch in away})
    with contextlib.closing(run_units(play, away, workers)) as all_done:
        for batch, future in all_done:
            bar.announce(batch)
            bar.update(sum(job.scenario.steps for job in batch))
            try:
                played = future.result()
            except WorkerError as e:
                raise WorkerError(
                    f"{batch[0].policy} in {batch[0].scenario.name}: {e} If memory is short, try fewer --workers. "
                    "Finished episodes are kept; continue with --resume."
                ) from None
            _check_versions(batch, played)
            yield batch, played


def _check_versions(batch: Batch, played: Played) -> None:
    """Refuses results of a worker with another version of the code, such as a node of a cluster may have."""
    from baselines.workers import WorkerError

    expected = [(job.key, job.fingerprint, ikgym.__version__) for job in batch]
    if [(row.key, row.fingerprint, row.machine.get("ikgym")) for row, _ in played] != expected:
        raise WorkerError(
            f"{batch[0].policy} in {batch[0].scenario.name}: a worker returned results of another job or version. It "
            f"has ikgym {played[0][0].machine.get('ikgym')}, here is {ikgym.__version__}. Install one on all nodes."
        )


class _Bar(tqdm):  # type: ignore[misc]  # tqdm has no types
    """A progress bar that counts steps, and names the batch which is played and the number of its last episode."""

    number, begun = 0, 0

    def announce(self, batch: Batch) -> None:
        """Names a batch."""
        self.begun += len(batch)
        name = printable(f"{batch[0].scenario.name} · {batch[0].policy}")
        self.set_description(f"{name} ({self.begun}/{self.number})", refresh=False)


@contextlib.contextmanager
def _progress(jobs: Sequence[Job], *, shown: bool) -> Iterator[_Bar]:
    """A progress bar on stderr."""
    bar = _Bar(
        total=sum(job.scenario.steps for job in jobs),
        disable=not shown or not jobs,
        file=sys.stderr,
        unit="step",
        unit_scale=True,
        dynamic_ncols=True,
        # A log file has no cursor to go back with.
        mininterval=0.1 if sys.stderr.isatty() else 10.0,
    )
    bar.number = len(jobs)
    # Messages, such as those on compilation, are printed above the bar.
    with bar, contextlib.nullcontext() if bar.disable else logging_redirect_tqdm([logger]):
        yield bar


def _write_tables(
    results: Results, lines: pd.DataFrame, rows: Rows, jobs: Sequence[Job], options: Options, command: str
) -> None:
    """Writes tables and the report."""
    from baselines.evaluation import report
    from baselines.evaluation.results import PAGE

    now = datetime.datetime.now(datetime.UTC)
    results.write("README.md", report.readme(lines, rows.skipped, command=command, date=now).encode())
    if options.report:
        from baselines.evaluation.html.page import page

        results.write(PAGE, page(results, lines, rows.skipped, command=command, date=now))
    if options.leaderboard or options.severities:
        from baselines.evaluation.rankings import write_map, write_ranking

        policies = options.policies if isinstance(options.policies, (list, tuple)) else [options.policies]
        names = [policy for policy in policies if isinstance(policy, str)]
        if options.leaderboard:
            write_ranking(results.directory, rows, names)
        if options.severities:
            write_map(results.directory, rows, jobs, names)
