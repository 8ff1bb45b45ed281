"""An evaluation: jobs are planned, played in batches and scored, and files are written."""

from __future__ import annotations

import contextlib
import datetime
import itertools
import sys
from collections.abc import Generator, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from threadpoolctl import threadpool_limits
from tqdm import tqdm
from tqdm.contrib.logging import logging_redirect_tqdm

import ikgym
from baselines.episodes import Episode, Tick, rollouts
from baselines.evaluation.jobs import Job, Options, plan
from baselines.evaluation.metrics import Row, Rows, describe, measure
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
            wrap, timed, workers, cluster, out, resume, overwrite, report, export, accelerations, noise_seeds, pairs,
            leaderboard, severities, progress, command.
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
    given = Options(scenarios=scenarios, policies=policies, **options)
    jobs, skipped = plan(given)
    if (workers := given.pool) is not None:
        workers.check()
    with contextlib.nullcontext() if given.out is None else locked(given.out):
        results = None
        if given.out is not None:
            from baselines.evaluation.results import Results

            results = Results(jobs, given)
        rows = {row.key: row for row in results.rows} if results else {}
        left = [job for job in jobs if not (results and results.is_done(job))]

        def add(batch: Batch, played: Played) -> None:
            rows.update((row.key, row) for row, _ in played)
            if results:
                results.add(batch, played)

        here, away = _share(left, workers)
        with _progress(left, shown=given.progress) as bar:
            for batch, played in _play_away(away, workers, bar):
                add(batch, played)
            for batch in here:
                _announce(bar, batch)
                add(batch, play(batch, bar.update))
        out = Rows([rows[job.key] for job in jobs], [*skipped, *(results.not_exported if results else [])])
        if results:
            results.save()
            _write_tables(results, out, jobs, given)
        return out


def play(batch: Batch, tick: Tick | None = None) -> Played:
    """Plays jobs of one policy in one scenario together; a timed one has to be alone.

    Raises:
        InvalidInputError: The policy refuses the observation, or chooses an invalid action.
    """
    first = batch[0]
    scenario, policy, wrap = first.scenario, first.bind(), first.specification.wrap
    # Of an arm that plays several episodes one after the other, those before a job's are played, too.
    in_a_row = 1 + max(job.before for job in batch)
    starts = dict.fromkeys(job.seeds._replace(seed=job.seeds.seed - job.before) for job in batch)
    seeds = [start._replace(seed=start.seed + k) for start in starts for k in range(in_a_row)]
    options: dict[str, Any] = {"timed": first.timed, "tick": tick}
    # The matrices of one arm are too small to share out, and threads would blur the times. Environment variables
    # affect only libraries that are not loaded yet.
    with threadpool_limits(limits=1):
        if wrap is not None and not isinstance(policy, SolverPolicy):
            from baselines.evaluation.foreign import play_wrapped

            episodes = [play_wrapped(scenario, policy, wrap, one, **options) for one in seeds]
        elif in_a_row == 1 and getattr(policy, "free_timing", False):
            from baselines.evaluation.motion.free_timing import play_to_end

            episodes = play_to_end(scenario, policy, seeds, preview=first.preview, **options)
        else:
            episodes = rollouts(scenario, policy, seeds, preview=first.preview, in_a_row=in_a_row, **options)
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


def _share(jobs: Sequence[Job], workers: Workers | None) -> tuple[list[Batch], list[Batch]]:
    """Batches that are played here, and by workers; on a cluster nothing is timed."""
    if workers is not None and workers.cluster is not None:
        return batches(job for job in jobs if job.timed), batches((job for job in jobs if not job.timed), BLOCK)
    every = batches(jobs)
    return (every, []) if workers is None or len(every) == 1 else ([], every)


def _play_away(
    away: Sequence[Batch], workers: Workers | None, bar: tqdm[Any]
) -> Generator[tuple[Batch, Played], None, None]:
    """Plays batches by workers, and yields each as soon as it is finished."""
    if workers is None or not away:
        return
    from baselines.workers import WorkerError, run_units

    check_picklable({batch[0].specification: None for batch in away})
    with contextlib.closing(run_units(play, away, workers)) as all_done:
        for batch, future in all_done:
            _announce(bar, batch)
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
    expected = [(job.key, job.fingerprint, ikgym.__version__) for job in batch]
    if [(row.key, row.fingerprint, row.machine.get("ikgym")) for row, _ in played] != expected:
        from baselines.workers import WorkerError

        raise WorkerError(
            f"{batch[0].policy} in {batch[0].scenario.name}: a worker returned results of another job or version. It "
            f"has ikgym {played[0][0].machine.get('ikgym')}, here is {ikgym.__version__}. Install one on all nodes."
        )


def _announce(bar: tqdm[Any], batch: Batch) -> None:
    bar.set_description(printable(f"{batch[0].scenario.name} · {batch[0].policy}"), refresh=False)


@contextlib.contextmanager
def _progress(jobs: Sequence[Job], *, shown: bool) -> Iterator[tqdm[Any]]:
    """A progress bar on stderr that counts steps; messages, such as those on compilation, are printed above it."""
    total, hidden = sum(job.scenario.steps for job in jobs), not shown or not jobs
    pause = 0.1 if sys.stderr.isatty() else 10.0  # a log file has no cursor to go back with
    bar = tqdm(total=total, disable=hidden, unit="step", unit_scale=True, dynamic_ncols=True, mininterval=pause)
    with bar, contextlib.nullcontext() if hidden else logging_redirect_tqdm([logger]):
        yield bar


def _write_tables(results: Results, rows: Rows, jobs: Sequence[Job], options: Options) -> None:
    """Writes tables and the report, of all rows in the folder."""
    from baselines.evaluation import report
    from baselines.evaluation.results import PAGE
    from baselines.evaluation.summary import summarise

    lines = summarise(results.rows)
    about: dict[str, Any] = {"command": options.command, "date": datetime.datetime.now(datetime.UTC)}
    results.write("README.md", report.readme(lines, rows.skipped, **about).encode())
    if options.report:
        from baselines.evaluation.html.page import page

        results.write(PAGE, page(results, lines, rows.skipped, **about))
    if options.leaderboard or options.severities:
        from baselines.evaluation.rankings import write_map, write_ranking

        policies = options.policies if isinstance(options.policies, (list, tuple)) else [options.policies]
        names = [policy for policy in policies if isinstance(policy, str)]
        if options.leaderboard:
            write_ranking(results.directory, rows, names)
        if options.severities:
            write_map(results.directory, rows, jobs, names)
