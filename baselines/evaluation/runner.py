"""Plays the jobs of a plan, in this process or in others: those of one policy in one scenario together."""

from __future__ import annotations

import contextlib
import logging
import sys
from collections.abc import Generator, Iterator, Sequence
from typing import Any

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from baselines.episodes import Episode, Policy, Seeds, Tick, rollouts, sequences
from baselines.evaluation.entrants import ForeignPolicy, check_sendable, play_wrapped
from baselines.evaluation.export import Motion
from baselines.evaluation.machine import describe
from baselines.evaluation.metrics import Row, measure
from baselines.evaluation.plan import Job
from baselines.evaluation.trajectory_log import trajectory_log
from baselines.evaluation.units import BLOCK, Checks, Done, Played, Unit, processor, units
from baselines.oracle import best_known
from baselines.workers import WorkerError, Workers, finished
from ikgym.compilation import logger
from ikgym.exceptions import InvalidInputError
from ikgym.preview import furthest
from ikgym.scenarios import Preview, Scenario


def run(jobs: Sequence[Job], *, workers: Workers, progress: bool) -> Generator[list[Played], None, None]:
    """Plays jobs in units, and hands out what came of each as soon as it is done.

    On a cluster nothing is timed: what needs the clock is played here, after all else.

    Args:
        jobs: What is to be done.
        workers: Who does it.
        progress: Whether to show a bar on stderr.

    Yields:
        What came of the jobs of a unit.

    Raises:
        InvalidInputError: A policy refuses what it is shown, cannot go to a worker, or chooses no action.
        WorkerError: Workers have died over a unit again and again, or have other costs than this machine.
        ClusterError: There is no cluster.
    """
    away, here = _shared(jobs, workers)
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
        line, done = _Line(bar), 0
        for unit, played in _elsewhere(away, workers):
            done += len(played)
            line.announce(unit, done, len(jobs))
            bar.update(sum(job.scenario.steps for job in unit.jobs))
            yield played
        for unit in here:
            done += len(unit.jobs)
            line.announce(unit, done, len(jobs))
            with line.watching():
                outcomes = play(unit.jobs, line.tick)
            yield outcomes


def _shared(jobs: Sequence[Job], workers: Workers) -> tuple[list[Unit], list[Unit]]:
    """What workers play, and what is played here."""
    if workers.cluster is not None:
        away = units((job for job in jobs if not job.timed), BLOCK)
        return away, units(job for job in jobs if job.timed)
    every = units(jobs)
    return (every, []) if workers.number > 1 and len(every) > 1 else ([], every)


def _elsewhere(away: Sequence[Unit], workers: Workers) -> Iterator[tuple[Unit, list[Played]]]:
    """What workers make of units, checked where they are no processes of this machine."""
    if not away:
        return
    check_sendable({unit.jobs[0].entrant: None for unit in away})
    checks = None if workers.cluster is None else Checks(play)
    with contextlib.closing(finished(do, away, workers)) as all_done:
        for unit, future in all_done:
            try:
                done = future.result()
            except WorkerError as e:
                first = unit.jobs[0]
                raise WorkerError(
                    f"{first.policy} in {first.scenario.name}: {e} If memory is short, try fewer --workers. Finished "
                    "episodes are kept; continue with --resume."
                ) from None
            if checks is not None:
                checks.check(unit, done)
            yield unit, done.played


def do(unit: Unit) -> Done:
    """Plays a unit, in the process of a worker."""
    return Done(unit.digest, play(unit.jobs), processor())


class _Line(logging.Handler):
    """The line of progress, which says so while kernels are compiled.

    Args:
        bar: What draws it.
    """

    def __init__(self, bar: Any) -> None:
        super().__init__()
        self._bar, self._description, self._compiling = bar, "", False

    def announce(self, unit: Unit, done: int, total: int) -> None:
        """Says which unit is played, or has been."""
        first = unit.jobs[0]
        self.describe(f"{first.scenario.name} · {first.policy} ({done}/{total})")

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


def play(batch: Sequence[Job], tick: Tick | None = None) -> list[Played]:
    """Plays jobs of one policy in one scenario together; a timed one has to be alone.

    Args:
        batch: The jobs.
        tick: See :data:`baselines.episodes.Tick`.
    """
    first, draws = batch[0], [job.seeds for job in batch]
    # The matrices of one arm are too small to share out, and threads would blur the times. Environment variables
    # would be heeded only by libraries that are not loaded yet, and NumPy is.
    with threadpool_limits(limits=1):
        if any(job.before for job in batch):
            episodes = _in_sequence(batch, first.make(), tick)
        else:
            episodes = play_episodes(first.scenario, first.make(), draws, first.preview, timed=first.timed, tick=tick)
    return [_played(job, one) for job, one in zip(batch, episodes, strict=True)]


def _in_sequence(batch: Sequence[Job], policy: Policy, tick: Tick | None) -> list[Episode]:
    """Episodes of arms that play several in a row: those before are played, too, since the policy learns from them.

    Raises:
        InvalidInputError: The policy plays a wrapped environment, whose states are its own.
    """
    first = batch[0]
    if isinstance(policy, ForeignPolicy) and policy.wrap is not None:
        raise InvalidInputError(f"wrap: {first.scenario.name} is played in sequences of episodes, without wrappers.")
    length = max(len(job.before) for job in batch) + 1
    starts = dict.fromkeys(job.seeds._replace(seed=job.seed - len(job.before)) for job in batch)
    chains = [[start._replace(seed=start.seed + k) for k in range(length)] for start in starts]
    episodes = sequences(first.scenario, policy, chains, preview=first.preview, timed=first.timed, tick=tick)
    played = {
        seeds: episode for pair in zip(chains, episodes, strict=True) for seeds, episode in zip(*pair, strict=True)
    }
    return [played[job.seeds] for job in batch]


def _played(job: Job, episode: Episode) -> Played:
    log = trajectory_log(job.scenario, job.seeds, episode) if job.first else None
    motion = Motion.of(job.scenario, job.seeds, episode) if job.exported else None
    return Played(job, _row(job, episode), log, motion)


def play_episodes(
    scenario: Scenario,
    policy: Policy,
    draws: Sequence[int | Seeds],
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
        tick: See :data:`baselines.episodes.Tick`.

    Raises:
        InvalidInputError: The policy refuses what it is shown, or chooses no action.
    """
    if isinstance(policy, ForeignPolicy) and policy.wrap is not None:
        return [play_wrapped(scenario, policy, one, timed=timed, tick=tick) for one in draws]
    return rollouts(scenario, policy, draws, preview=preview, timed=timed, tick=tick)


def _row(job: Job, episode: Episode) -> Row:
    return measure(
        job.scenario,
        job.policy,
        job.parameters,
        job.seeds,
        episode,
        machine=describe(),
        preview=furthest(job.preview),
        fingerprint=job.fingerprint,
        test_set=job.test_set,
        best_known=best_known.cost(job.scenario, job.seed, job.arm_seed),
        ideal=job.ideal,
    )
