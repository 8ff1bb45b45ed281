"""Plays the jobs of an evaluation, in this process or in others: those of one policy in one scenario together."""

from __future__ import annotations

import contextlib
import itertools
import sys
from collections.abc import Generator, Iterable, Iterator, Sequence

from threadpoolctl import threadpool_limits
from tqdm import tqdm
from tqdm.contrib.logging import logging_redirect_tqdm

import ikgym
from baselines.canonical import canonical, jsonable
from baselines.episodes import Tick, rollouts, sequences
from baselines.evaluation.foreign import ForeignPolicy, play_wrapped
from baselines.evaluation.jobs import Job
from baselines.evaluation.metrics import Row, describe, measure
from baselines.evaluation.motion.free_timing import play_to_end
from baselines.evaluation.policies import check_picklable
from baselines.fingerprints import fingerprint
from baselines.oracle import best_known
from baselines.oracle.stripped import ideal
from baselines.policy.protocol import Policy
from baselines.recording import Episode, Seeds
from baselines.workers import WorkerError, Workers, finished
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.compilation import logger
from ikgym.scenarios import Preview, Scenario
from ikgym.scenarios.preview import furthest

#: Most episodes that are played side by side: their records are in memory until all of them are finished.
MOST = 64
#: The same on a cluster, where small batches are spread better, and cost less if a node is lost.
BLOCK = 8

#: Jobs that are played together.
Batch = tuple[Job, ...]
#: The row of each job of a batch, and the record of the episode if the job asks for it.
Results = list[tuple[Row, Episode | None]]


def run(jobs: Sequence[Job], workers: Workers, *, progress: bool) -> Generator[tuple[Batch, Results], None, None]:
    """Plays jobs in batches, and yields each as soon as it is finished.

    On a cluster nothing is timed: timed jobs are played here, after all others.

    Raises:
        InvalidInputError: A policy refuses the observation, cannot be sent to a worker, or chooses an invalid action.
        WorkerError: Workers died repeatedly over one batch, or have another version of the code.
        ClusterError: There is no cluster.
    """
    away, here = _shared(jobs, workers)
    bar = tqdm(
        total=sum(job.scenario.steps for job in jobs),
        disable=not progress or not jobs,
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
        for batch, results in _elsewhere(away, workers):
            announce(batch)
            bar.update(sum(job.scenario.steps for job in batch))
            yield batch, results
        for batch in here:
            announce(batch)
            yield batch, play(batch, bar.update)


def play(batch: Batch, tick: Tick | None = None) -> Results:
    """Plays jobs of one policy in one scenario together; a timed one has to be alone."""
    first = batch[0]
    policy = first.bind()
    # The matrices of one arm are too small to share out, and threads would blur the times. Environment variables
    # affect only libraries that are not loaded yet.
    with threadpool_limits(limits=1):
        if any(job.before for job in batch):
            episodes = _in_sequence(batch, policy, tick)
        else:
            seeds = [job.seeds for job in batch]
            episodes = play_episodes(first.scenario, policy, seeds, first.preview, timed=first.timed, tick=tick)
    digests = {"fingerprint": first.fingerprint, "ideal": fingerprint(ideal(first.scenario))}
    return [(_row(job, one, **digests), one if job.record else None) for job, one in zip(batch, episodes, strict=True)]


def play_episodes(
    scenario: Scenario,
    policy: Policy,
    seeds: Sequence[int | Seeds],
    preview: Preview,
    *,
    timed: bool,
    tick: Tick | None = None,
) -> list[Episode]:
    """Plays episodes of a policy, in the wrapped environment if it needs one; with free timing, to the end of the path.

    Raises:
        InvalidInputError: The policy refuses the observation, or chooses an invalid action.
    """
    if isinstance(policy, ForeignPolicy) and policy.wrap is not None:
        return [play_wrapped(scenario, policy, one, timed=timed, tick=tick) for one in seeds]
    if getattr(policy, "free_timing", False):
        return play_to_end(scenario, policy, seeds, preview, timed=timed, tick=tick)
    return rollouts(scenario, policy, seeds, preview=preview, timed=timed, tick=tick)


def batches(jobs: Iterable[Job], most: int = MOST) -> list[Batch]:
    """Jobs that are played together, in their order.

    Timed jobs are played alone, and so are those of a reference that is bound to one episode.
    """
    out: list[Batch] = []
    for _, alike in itertools.groupby(jobs, _together):
        left = tuple(alike)
        size = 1 if left[0].timed else most
        out += [left[first : first + size] for first in range(0, len(left), size)]
    return out


def _together(job: Job) -> tuple[object, ...]:
    return job.scenario.name, job.policy, canonical(job.parameters), canonical(jsonable(job.given)), job.timed


def _in_sequence(batch: Batch, policy: Policy, tick: Tick | None) -> list[Episode]:
    """Episodes of arms that play several one after the other; those before a job's are played, too."""
    first = batch[0]
    if isinstance(policy, ForeignPolicy) and policy.wrap is not None:
        raise InvalidInputError(f"wrap: {first.scenario.name} is played in sequences of episodes, without wrappers.")
    length = max(job.before for job in batch) + 1
    starts = dict.fromkeys(job.seeds._replace(seed=job.seeds.seed - job.before) for job in batch)
    chains = [[start._replace(seed=start.seed + k) for k in range(length)] for start in starts]
    episodes = sequences(first.scenario, policy, chains, preview=first.preview, timed=first.timed, tick=tick)
    played = {
        seeds: episode for pair in zip(chains, episodes, strict=True) for seeds, episode in zip(*pair, strict=True)
    }
    return [played[job.seeds] for job in batch]


def _row(job: Job, episode: Episode, **digests: str) -> Row:
    return measure(
        job.scenario,
        job.policy,
        job.parameters,
        job.seeds,
        episode,
        machine=describe(),
        preview=furthest(job.preview),
        test_set=job.test_set,
        best_known=best_known.cost(job.scenario, job.seeds.seed, job.seeds.arm_seed),
        **digests,
    )


def _shared(jobs: Sequence[Job], workers: Workers) -> tuple[list[Batch], list[Batch]]:
    """The batches that workers play, and those that are played here."""
    if workers.cluster is not None:
        away = batches((job for job in jobs if not job.timed), BLOCK)
        return away, batches(job for job in jobs if job.timed)
    every = batches(jobs)
    return (every, []) if workers.number > 1 and len(every) > 1 else ([], every)


def _elsewhere(away: Sequence[Batch], workers: Workers) -> Iterator[tuple[Batch, Results]]:
    """The batches that workers play."""
    if not away:
        return
    check_picklable({batch[0].specification: None for batch in away})
    with contextlib.closing(finished(play, away, workers)) as all_done:
        for batch, future in all_done:
            try:
                results = future.result()
            except WorkerError as e:
                raise WorkerError(
                    f"{batch[0].policy} in {batch[0].scenario.name}: {e} If memory is short, try fewer --workers. "
                    "Finished episodes are kept; continue with --resume."
                ) from None
            check_versions(batch, results)
            yield batch, results


def check_versions(batch: Batch, results: Results) -> None:
    """Refuses results of a worker with another version of the code, such as a node of a cluster may have."""
    digest = batch[0].fingerprint
    expected = [(job.key, digest, ikgym.__version__) for job in batch]
    if [(row.key, row.fingerprint, row.machine.get("ikgym")) for row, _ in results] != expected:
        raise WorkerError(
            f"A worker has played something else than {batch[0].policy} in {batch[0].scenario.name}: it has ikgym "
            f"{results[0][0].machine.get('ikgym')}, here is {ikgym.__version__}. Install the same on all nodes."
        )
