"""Plays the jobs of a plan, in this process or in others: those of one policy in one scenario together."""

from __future__ import annotations

import contextlib
import itertools
import logging
import multiprocessing
import signal
import sys
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from baselines.canonical import canonical, jsonable
from baselines.evaluation.machine import describe
from baselines.evaluation.metrics import Row, measure
from baselines.evaluation.plan import Job
from baselines.evaluation.rollout import Episode, Tick, rollout, rollouts
from baselines.oracle import best_known
from ikgym.compilation import logger
from ikgym.exceptions import IkgymError
from ikgym.scenarios.scenario import furthest

#: The course of an episode, as arrays by name.
Series = dict[str, npt.NDArray[Any]]
#: A job, its row, and the course of the episode if the job is a first one.
Outcome = tuple[Job, Row, Series | None]

#: Most episodes that are played in step: their courses are in memory until all of them are done.
MOST = 64


class WorkerError(IkgymError):
    """A worker process has died."""


def run(jobs: Sequence[Job], *, workers: int, progress: bool) -> Generator[list[Outcome], None, None]:
    """Plays jobs in batches, and hands out what came of each batch as soon as it is done.

    Args:
        jobs: What is to be done.
        workers: Processes that do it; 1 means this one.
        progress: Whether to show a bar on stderr.

    Yields:
        What came of the jobs of a batch.

    Raises:
        InvalidInputError: A policy refuses what it is shown.
        WorkerError: A worker process has died.
    """
    parts, done = batches(jobs), 0
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
        line = _Line(bar)

        def announce(batch: Sequence[Job]) -> None:
            nonlocal done
            done += len(batch)
            job = batch[0]
            line.describe(f"{job.scenario.name} · {job.policy} ({done}/{len(jobs)})")

        if workers == 1 or len(parts) < 2:
            for batch in parts:
                announce(batch)
                with line.watching():
                    outcomes = play(batch, line.tick)
                yield outcomes
        else:
            for batch, outcomes in _in_processes(parts, workers):
                announce(batch)
                bar.update(sum(job.scenario.steps for job in batch))
                yield outcomes


class _Line(logging.Handler):
    """The line of progress, which says so while kernels are compiled.

    Args:
        bar: What draws it.
    """

    def __init__(self, bar: Any) -> None:
        super().__init__()
        self._bar, self._description, self._compiling = bar, "", False

    def describe(self, text: str) -> None:
        """Says what is played."""
        self._description = text
        self._bar.set_description(text, refresh=False)

    def tick(self, steps: int) -> None:
        """Moves the bar on."""
        if self._compiling:
            self._compiling = False
            self._bar.set_description(self._description, refresh=False)
        self._bar.update(steps)

    def emit(self, record: logging.LogRecord) -> None:
        """Shows what is compiled in the line itself; other messages above it."""
        text = record.getMessage()
        if not text.startswith("Compiling "):
            self._bar.write(text, file=sys.stderr)
            return
        self._compiling = True
        self._bar.set_description(text.partition(",")[0], refresh=True)  # what, and that it happens once

    @contextlib.contextmanager
    def watching(self) -> Iterator[None]:
        """Listens to messages while something is played, where the line is shown."""
        if self._bar.disable:
            yield
            return
        logger.addHandler(self)
        try:
            yield
        finally:
            logger.removeHandler(self)


def batches(jobs: Iterable[Job]) -> list[list[Job]]:
    """Jobs that are played together, in their order.

    Those that are timed are played alone. So are those of a reference that is made for one episode and knows no other:
    its jobs differ in what it is made with.
    """
    out: list[list[Job]] = []
    for _, alike in itertools.groupby(jobs, _together):
        left = list(alike)
        size = 1 if left[0].timed else MOST
        out += [left[first : first + size] for first in range(0, len(left), size)]
    return out


def _together(job: Job) -> tuple[object, ...]:
    return job.scenario.name, job.policy, canonical(job.parameters), canonical(jsonable(job.given)), job.timed


def play(batch: Sequence[Job], tick: Tick | None = None) -> list[Outcome]:
    """Plays jobs of one policy in one scenario together; a timed one has to be alone.

    Args:
        batch: The jobs.
        tick: See :data:`baselines.evaluation.rollout.Tick`.
    """
    first = batch[0]
    scenario, policy = first.scenario, first.make()
    # The matrices of one arm are too small to share out, and threads would blur the times. Environment variables
    # would be heeded only by libraries that are not loaded yet, and NumPy is.
    with threadpool_limits(limits=1):
        if first.timed:
            episodes = [rollout(scenario, policy, first.seed, preview=first.preview, tick=tick)]
        else:
            episodes = rollouts(scenario, policy, [job.seed for job in batch], preview=first.preview, tick=tick)
    return [(job, _row(job, e), course(job, e) if job.first else None) for job, e in zip(batch, episodes, strict=True)]


def _row(job: Job, episode: Episode) -> Row:
    return measure(
        job.scenario,
        job.policy,
        job.parameters,
        job.seed,
        episode,
        machine=describe(),
        preview=furthest(job.preview),
        fingerprint=job.fingerprint,
        test_set=job.test_set,
        best_known=best_known.cost(job.scenario, job.seed),
    )


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


def _in_processes(parts: Sequence[list[Job]], workers: int) -> Iterator[tuple[list[Job], list[Outcome]]]:
    # Spawned, not forked: a fork would inherit numba's and the BLAS's threads without their locks' owners.
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    executor = ProcessPoolExecutor(min(workers, len(parts)), context, initializer=_die_quietly)
    finished = False
    try:
        futures = {executor.submit(play, batch): batch for batch in parts}
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
