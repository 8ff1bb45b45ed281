"""Plays the jobs of a plan, in this process or in others, one row at a time."""

from __future__ import annotations

import multiprocessing
import signal
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from baselines.machine import describe
from baselines.metrics import Row, measure
from baselines.plan import Job
from baselines.rollout import Episode, rollout
from ikgym.exceptions import IkgymError

#: The course of an episode, as arrays by name.
Series = dict[str, npt.NDArray[Any]]
Outcome = tuple[Row, Series | None]


class WorkerError(IkgymError):
    """A worker process has died."""


def run(jobs: Sequence[Job], *, workers: int, progress: bool) -> Generator[tuple[Job, Row, Series | None], None, None]:
    """Plays jobs, and hands out each result as soon as it is there.

    Args:
        jobs: What is to be done.
        workers: Processes that do it; 1 means this one.
        progress: Whether to show a bar on stderr.

    Yields:
        The job, its row, and the course of the episode if the job is a first one.

    Raises:
        InvalidInputError: A policy refuses what it is shown.
        WorkerError: A worker process has died.
    """
    with tqdm(
        total=sum(job.scenario.steps for job in jobs),
        disable=not progress or not jobs,
        file=sys.stderr,
        unit="step",
        unit_scale=True,
        dynamic_ncols=True,
        # A log file has no cursor to go back with.
        mininterval=0.1 if sys.stderr.isatty() else 10.0,
    ) as bar:

        def announce(job: Job, number: int) -> None:
            bar.set_description(f"{job.scenario.name} · {job.policy} ({number}/{len(jobs)})", refresh=False)

        if workers == 1 or len(jobs) < 2:
            for number, job in enumerate(jobs, 1):
                announce(job, number)
                yield job, *play(job, bar.update)
        else:
            for number, (job, outcome) in enumerate(_in_processes(jobs, workers), 1):
                announce(job, number)
                bar.update(job.scenario.steps)
                yield job, *outcome


def play(job: Job, tick: Callable[[int], object] | None = None) -> Outcome:
    """Plays one job; for `tick` see :func:`baselines.rollout.rollout`."""
    policy = job.make()
    # The matrices of one arm are too small to share out, and threads would blur the times. Environment variables
    # would be heeded only by libraries that are not loaded yet, and NumPy is.
    with threadpool_limits(limits=1):
        episode = rollout(job.scenario, policy, job.seed, preview=job.preview, tick=tick)
    row = measure(
        job.scenario,
        job.policy,
        job.parameters,
        job.seed,
        episode,
        machine=describe(),
        preview=job.preview,
        fingerprint=job.fingerprint,
    )
    return row, course(job, episode) if job.first else None


def course(job: Job, episode: Episode) -> Series:
    """What plots show of an episode, at the steps that count.

    Returns:
        ``time`` in [s], of shape (k,), and over it ``nominal`` and ``pose`` (k, m), ``q`` and ``qdot`` (k, n),
        ``position_error`` and, where there is one, ``orientation_error`` (k,); ``nominal_q`` (k, n) where there is a
        nominal joint path; ``sliding`` says which joints slide, of shape (n,).
    """
    scenario = job.scenario
    after = np.flatnonzero(scenario.counted())
    kept = after - 1
    series: Series = {
        "time": after * scenario.dt,
        "nominal": scenario.nominal(job.seed)[after],
        "pose": episode.pose[kept],
        "q": episode.q[kept],
        "qdot": episode.qdot[kept],
        "position_error": episode.position_error[kept],
        "sliding": np.array(scenario.arm.prismatic, dtype=np.bool_),
    }
    if scenario.task.has_orientation:
        series["orientation_error"] = episode.orientation_error[kept]
    path = scenario.nominal_joint_path(job.seed)
    if path is not None:
        series["nominal_q"] = path[after]
    return series


def _in_processes(jobs: Sequence[Job], workers: int) -> Iterator[tuple[Job, Outcome]]:
    # Spawned, not forked: a fork would inherit numba's and the BLAS's threads without their locks' owners.
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    executor = ProcessPoolExecutor(min(workers, len(jobs)), context, initializer=_die_quietly)
    finished = False
    try:
        futures = {executor.submit(play, job): job for job in jobs}
        for future in as_completed(futures):
            yield futures.pop(future), future.result()
        finished = True
    except BrokenProcessPool:
        raise WorkerError(
            "A worker process has died, perhaps for want of memory: try fewer --workers. What was finished is kept; "
            "go on with --resume."
        ) from None
    finally:
        if not finished:  # nobody should wait for episodes that nobody will read
            for child in set(multiprocessing.active_children()) - others:
                child.terminate()
        executor.shutdown(cancel_futures=True)


def _die_quietly() -> None:
    """Lets Ctrl-C end a worker without a traceback."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
