"""Plays the jobs of an evaluation, in this process or in others: those of one policy in one scenario together."""

from __future__ import annotations

import contextlib
import functools
import itertools
from collections.abc import Generator, Iterable, Sequence
from typing import Any

from threadpoolctl import threadpool_limits

import ikgym
from baselines.canonical import canonical, jsonable
from baselines.episodes import Tick, rollouts
from baselines.evaluation.foreign import ForeignPolicy, WrappedEnvironment
from baselines.evaluation.jobs import Job
from baselines.evaluation.metrics import Row, describe, measure
from baselines.evaluation.motion.free_timing import play_to_end
from baselines.evaluation.policies import check_picklable
from baselines.fingerprints import fingerprint
from baselines.oracle import best_known
from baselines.oracle.stripped import ideal
from baselines.recording import Episode
from baselines.workers import WorkerError, Workers, finished
from ikgym.scenarios.preview import furthest

#: Most episodes that are played side by side: their records are in memory until all of them are finished.
MOST = 64
#: The same on a cluster, where small batches are spread better, and cost less if a node is lost.
BLOCK = 8

#: Jobs that are played together.
Batch = tuple[Job, ...]
#: The row of each job of a batch, and the record of the episode if the job asks for it.
Results = list[tuple[Row, Episode | None]]


def play(batch: Batch, tick: Tick | None = None) -> Results:
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
    if isinstance(policy, ForeignPolicy) and policy.wrap is not None:
        options["begin"] = functools.partial(WrappedEnvironment, policy)
    # The matrices of one arm are too small to share out, and threads would blur the times. Environment variables
    # affect only libraries that are not loaded yet.
    with threadpool_limits(limits=1):
        if in_a_row == 1 and getattr(policy, "free_timing", False):
            episodes = play_to_end(scenario, policy, seeds, **options)
        else:
            episodes = rollouts(scenario, policy, seeds, in_a_row=in_a_row, **options)
    played = dict(zip(seeds, episodes, strict=True))
    about: dict[str, Any] = {"machine": describe(), "preview": furthest(first.preview), "test_set": first.test_set}
    about |= {"fingerprint": first.fingerprint, "ideal": fingerprint(ideal(scenario))}
    out: Results = []
    for job in batch:
        episode, best = played[job.seeds], best_known.cost(scenario, job.seeds.seed, job.seeds.arm_seed)
        row = measure(scenario, job.policy, job.parameters, job.seeds, episode, best_known=best, **about)
        out.append((row, episode if job.record else None))
    return out


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


def split(jobs: Sequence[Job], workers: Workers) -> tuple[list[Batch], list[Batch]]:
    """The batches that workers play, and those that are played here, after the others.

    On a cluster nothing is timed: timed jobs are played here.
    """
    if workers.cluster is not None:
        away = batches((job for job in jobs if not job.timed), BLOCK)
        return away, batches(job for job in jobs if job.timed)
    every = batches(jobs)
    return (every, []) if workers.number > 1 and len(every) > 1 else ([], every)


def play_elsewhere(away: Sequence[Batch], workers: Workers) -> Generator[tuple[Batch, Results], None, None]:
    """Plays batches by workers, and yields each as soon as it is finished.

    Raises:
        InvalidInputError: A policy refuses the observation, cannot be sent to a worker, or chooses an invalid action.
        WorkerError: Workers died repeatedly over one batch, or have another version of the code.
        ClusterError: There is no cluster.
    """
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
