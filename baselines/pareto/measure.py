"""Plays the contenders on sets of episodes, each set in a folder of results that may be gone on with."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
from collections.abc import Iterable

from baselines import frozen
from baselines.machine import describe
from baselines.pareto.contenders import Contender
from baselines.pareto.points import Measured, Point
from baselines.plan import Job, Plan, make_plan
from baselines.results import Results, slug
from baselines.runner import run
from ikgym import scenarios


def fixed() -> tuple[str, ...]:
    """The scenarios with one episode, but for those that hold their points: there the task is to iterate."""
    every = map(scenarios.get, scenarios.names())
    return tuple(s.name for s in every if not s.random and s.counted()[1:].all())


def measure(
    name: str,
    contenders: Iterable[Contender],
    out: pathlib.Path,
    *,
    episodes: int | None = None,
    workers: int = 1,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool = False,
) -> Measured:
    """Plays all contenders on a set. First what needs no clock, then, with nothing else under way, what does.

    Args:
        name: A frozen set, or a scenario.
        contenders: Who plays; those that do not suit the scenario are left out.
        out: A folder; the results go into a folder of the set's name therein.
        episodes: The first so many of the set, for trials.
        workers: Processes for what needs no clock.
        resume: Goes on with what is in the folder.
        overwrite: Throws away what is in the folder.
        progress: Whether to show bars on stderr.

    Raises:
        UnknownNameError: There is no such set or scenario.
        InvalidInputError: A frozen set has drifted.
        ResultsError: The folder cannot be read or written, or is not to be gone on with.
        WorkerError: A worker process has died.
    """
    plans = plan(name, contenders, episodes)
    whole = Plan(tuple({job.key: job for jobs in plans.values() for job in jobs}.values()), ())
    results = Results(out / slug(name), whole, describe(), resume=resume, overwrite=overwrite)
    left = [job for job in whole.jobs if not results.done(job)]
    for timed in (False, True):
        part = [job for job in left if job.timed == timed]
        with contextlib.closing(run(part, workers=1 if timed else workers, progress=progress)) as batches:
            for outcomes in batches:
                results.add(outcomes)
    rows = {row.key: row for row in results.rows}
    return Measured(
        name=name,
        fingerprint=whole.jobs[0].fingerprint,
        seeds=tuple(dict.fromkeys(job.seed for job in whole.jobs)),
        points=tuple(Point.of(spec, [rows[job.key] for job in jobs]) for spec, jobs in plans.items()),
    )


def plan(name: str, contenders: Iterable[Contender], episodes: int | None = None) -> dict[str, list[Job]]:
    """The episodes of each contender, seed by seed of the policy; without those that do not suit the scenario.

    Args:
        name: A frozen set, or a scenario.
        contenders: Who plays.
        episodes: The first so many of the set; all if left out.
    """
    sets, names = ((name,), ()) if name in frozen.names() else ((), (name,))
    everyone = list(contenders)
    unsuited = {s.policy for s in make_plan(names, [v for c in everyone for v in c.variants], frozen=sets).skipped}
    out: dict[str, list[Job]] = {}
    for contender in everyone:
        variants = [variant for variant in contender.variants if variant[0] not in unsuited]
        for variant in variants:
            jobs = make_plan(names, [variant], frozen=sets, timed=contender.timed).jobs[:episodes]
            # No course is kept: there are many contenders, and nobody draws them.
            out.setdefault(contender.spec, []).extend(dataclasses.replace(job, first=False) for job in jobs)
    return out
