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
from typing import Any, NamedTuple

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from baselines.canonical import canonical, jsonable
from baselines.episode import Draw
from baselines.evaluation.entrants import ForeignPolicy, check_sendable, play_wrapped
from baselines.evaluation.export import Motion
from baselines.evaluation.machine import describe
from baselines.evaluation.metrics import Row, measure
from baselines.evaluation.plan import Job
from baselines.evaluation.rollout import Episode, Player, Tick, rollout, rollouts, sequence
from baselines.evaluation.trajectory_log import TrajectoryLog, trajectory_log
from baselines.lifetime import end_with_parent
from baselines.oracle import best_known
from ikgym.compilation import logger
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.preview import furthest
from ikgym.scenarios import Preview, Scenario

#: Most episodes that are played in step: what happens in them is in memory until all of them are done.
MOST = 64


class WorkerError(IkgymError):
    """A worker process has died."""


class Played(NamedTuple):
    """A job that is done.

    Attributes:
        job: What was to be done.
        row: What came out.
        log: The trajectory log of the episode if the job is a first one.
        motion: The joint motion if it is to be kept.
    """

    job: Job
    row: Row
    log: TrajectoryLog | None
    motion: Motion | None


def run(jobs: Sequence[Job], *, workers: int, progress: bool) -> Generator[list[Played], None, None]:
    """Plays jobs in batches, and hands out what came of each batch as soon as it is done.

    Args:
        jobs: What is to be done.
        workers: Processes that do it; 1 means this one.
        progress: Whether to show a bar on stderr.

    Yields:
        What came of the jobs of a batch.

    Raises:
        InvalidInputError: A policy refuses what it is shown, cannot go to a worker, or chooses no action.
        WorkerError: A worker process has died.
    """
    parts, done = batches(jobs), 0
    elsewhere = workers > 1 and len(parts) > 1
    if elsewhere:
        check_sendable({job.entrant: None for job in jobs})
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

        if not elsewhere:
            for batch in parts:
                announce(batch)
                with line.watching():
                    outcomes = play(batch, line.tick)
                yield outcomes
        else:
            for batch, played in _in_processes(parts, workers):
                announce(batch)
                bar.update(sum(job.scenario.steps for job in batch))
                yield played


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


def play(batch: Sequence[Job], tick: Tick | None = None) -> list[Played]:
    """Plays jobs of one policy in one scenario together; a timed one has to be alone.

    Args:
        batch: The jobs.
        tick: See :data:`baselines.evaluation.rollout.Tick`.
    """
    first, draws = batch[0], [job.draw for job in batch]
    # The matrices of one arm are too small to share out, and threads would blur the times. Environment variables
    # would be heeded only by libraries that are not loaded yet, and NumPy is.
    with threadpool_limits(limits=1):
        if any(job.before for job in batch):
            episodes = _in_sequence(batch, first.make(), tick)
        else:
            episodes = play_episodes(first.scenario, first.make(), draws, first.preview, timed=first.timed, tick=tick)
    return [_played(job, one) for job, one in zip(batch, episodes, strict=True)]


def _in_sequence(batch: Sequence[Job], policy: Player, tick: Tick | None) -> list[Episode]:
    """Episodes of arms that play several in a row: those before are played, too, since the policy learns from them.

    Raises:
        InvalidInputError: The policy plays a wrapped environment, whose states are its own.
    """
    first = batch[0]
    alone = first.timed or isinstance(policy, ForeignPolicy)
    if isinstance(policy, ForeignPolicy) and policy.wrap is not None:
        raise InvalidInputError(f"wrap: {first.scenario.name} is played in sequences of episodes, without wrappers.")
    length = max(len(job.before) for job in batch) + 1
    starts = list(dict.fromkeys(job.draw._replace(seed=job.seed - len(job.before)) for job in batch))
    out: dict[Draw, Episode] = {}
    for arms in [[one] for one in starts] if alone else [starts]:
        episodes = [[one._replace(seed=one.seed + k) for one in arms] for k in range(length)]
        all_played = sequence(
            first.scenario, policy, episodes, preview=first.preview, alone=alone, timed=first.timed, tick=tick
        )
        for draws, played in zip(episodes, all_played, strict=True):
            out |= zip(draws, played, strict=True)
    return [out[job.draw] for job in batch]


def _played(job: Job, episode: Episode) -> Played:
    log = trajectory_log(job.scenario, job.draw, episode) if job.first else None
    motion = Motion.of(job.scenario, job.seed, episode) if job.exported else None
    return Played(job, _row(job, episode), log, motion)


def play_episodes(
    scenario: Scenario,
    policy: Player,
    draws: Sequence[int | Draw],
    preview: Preview,
    *,
    timed: bool,
    tick: Tick | None = None,
) -> list[Episode]:
    """Plays episodes of a policy, together where it may be called for many arms.

    Args:
        scenario: What is to be tracked.
        policy: Who tracks it.
        draws: The reset seeds, or what is drawn how; of what is timed, one.
        preview: What the policy is shown.
        timed: Whether to keep the times of single calls.
        tick: See :data:`baselines.evaluation.rollout.Tick`.

    Raises:
        InvalidInputError: The policy refuses what it is shown, or chooses no action.
    """
    if isinstance(policy, ForeignPolicy):
        if policy.wrap is not None:
            return [play_wrapped(scenario, policy, draw, timed=timed, tick=tick) for draw in draws]
        return [rollout(scenario, policy, draw, preview=preview, timed=timed, tick=tick) for draw in draws]
    if timed:
        (draw,) = draws
        return [rollout(scenario, policy, draw, preview=preview, tick=tick)]
    return rollouts(scenario, policy, draws, preview=preview, tick=tick)


def _row(job: Job, episode: Episode) -> Row:
    return measure(
        job.scenario,
        job.policy,
        job.parameters,
        job.draw,
        episode,
        machine=describe(),
        preview=furthest(job.preview),
        fingerprint=job.fingerprint,
        test_set=job.test_set,
        best_known=best_known.cost(job.scenario, job.seed, job.arm_seed),
        ideal=job.ideal,
    )


def _in_processes(parts: Sequence[list[Job]], workers: int) -> Iterator[tuple[list[Job], list[Played]]]:
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
    """Lets Ctrl-C end a worker without a traceback, and ends it with its parent."""
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_DFL)
