"""Plays entries on sets of episodes, in a folder that may be resumed: what needs no clock, then what does."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

from baselines.evaluation import test_sets
from baselines.evaluation.machine import describe
from baselines.evaluation.metrics import Row
from baselines.evaluation.pages import sets
from baselines.evaluation.pages.entries import Entry
from baselines.evaluation.pages.measurement import Line, Section
from baselines.evaluation.plan import EvaluationPlan, Job, make_plan
from baselines.evaluation.results import Results, slug
from baselines.evaluation.runner import run
from baselines.files.locks import locked
from baselines.workers import ALONE, Workers
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario

Key = TypeVar("Key")


def plan(
    where: str | Scenario, entries: Iterable[Entry], episodes: int | None = None, *, split: str = "test"
) -> dict[str, list[Job]]:
    """The episodes of each entry by its label, variant by variant; without solvers that do not suit the scenario.

    Args:
        where: A name of :func:`baselines.evaluation.pages.sets.get`, or a scenario.
        entries: Who plays.
        episodes: The first so many; if left out all of a test set, and 32 of a random scenario.
        split: Where the seeds of a random scenario come from; a test set has its own.

    Raises:
        UnknownNameError: There is no such test set, scenario, policy or parameter.
        InvalidInputError: A parameter is refused, nobody suits the scenario, an agent does not, or a test set has
            drifted.
    """
    everyone = list(entries)
    fixed = isinstance(where, str) and where in test_sets.names()
    kind: dict[str, Any] = {"test_sets": (where,)} if fixed else {"episodes": episodes or sets.EPISODES, "split": split}
    played = () if fixed else (sets.get(where) if isinstance(where, str) else where,)
    skipped = {s.policy for s in make_plan(played, [v for one in everyone for v in one.variants], **kind).skipped}
    out: dict[str, list[Job]] = {}
    for one in everyone:
        for variant in one.variants:
            try:
                jobs = make_plan(played, [variant], timed=max(one.timed, 1), **kind).jobs
            except InvalidInputError:
                if variant[0] in skipped:
                    continue
                raise
            # No trajectory log is kept: there are many entries, and nobody draws them.
            timed = one.timed > 0
            some = jobs[: math.ceil(one.share * len(jobs))][:episodes]
            kept = (dataclasses.replace(job, first=False, timed=job.timed and timed) for job in some)
            out.setdefault(one.label, []).extend(kept)
    if missing := [one.label for one in everyone if one.training and one.label not in out]:
        name = where if isinstance(where, str) else where.name
        raise InvalidInputError(f"{', '.join(missing)}: made for another task or arm than that of {name}.")
    return out


def play(
    plans: Mapping[Key, Sequence[Job]],
    folder: pathlib.Path | None = None,
    *,
    workers: Workers = ALONE,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool = False,
) -> dict[Key, list[Row]]:
    """The rows of all jobs. First what needs no clock is played, then, with nothing else under way, what does.

    Args:
        plans: The jobs of each entry; an episode that several ask for is played once, timed if one of them wants it.
        folder: For the results; if left out they are kept in memory alone.
        workers: Who plays what needs no clock.
        resume: Continues with what is in the folder.
        overwrite: Deletes what is in the folder.
        progress: Whether to show bars on stderr.

    Raises:
        ResultsError: The folder cannot be read or written, or is not to be continued with.
        WorkerError: Workers have died over a unit again and again, or have other costs than this machine.
        ClusterError: There is no cluster.
    """
    jobs: dict[Any, Job] = {}
    for job in (job for some in plans.values() for job in some):
        if job.key not in jobs or job.timed:
            jobs[job.key] = job
    workers.check()
    with contextlib.nullcontext() if folder is None else locked(folder):
        rows = _played(
            EvaluationPlan(tuple(jobs.values()), ()),
            folder,
            workers=workers,
            resume=resume,
            overwrite=overwrite,
            progress=progress,
        )
    return {key: [rows[job.key] for job in some] for key, some in plans.items()}


def _played(
    whole: EvaluationPlan,
    folder: pathlib.Path | None,
    *,
    workers: Workers,
    resume: bool,
    overwrite: bool,
    progress: bool,
) -> dict[Any, Row]:
    """The rows of a plan by the keys of its jobs."""
    rows, results = dict[Any, Row](), None
    if folder is not None:
        results = Results(folder, whole, describe(), resume=resume, overwrite=overwrite)
        rows = {row.key: row for row in results.rows}
    left = [job for job in whole.jobs if results is None or not results.done(job)]
    for timed in (False, True):
        part = [job for job in left if job.timed == timed]
        with contextlib.closing(run(part, workers=ALONE if timed else workers, progress=progress)) as batches:
            for outcomes in batches:
                rows |= {row.key: row for _, row, *_ in outcomes}
                if results is not None:
                    results.add(outcomes)
    return rows


def measure(
    name: str,
    entries: Mapping[str, Sequence[Entry]],
    out: pathlib.Path,
    *,
    episodes: int | None = None,
    **options: Any,
) -> dict[str, Section]:
    """Plays a set of episodes for all pages at once.

    Args:
        name: A test set or a scenario, see :func:`baselines.evaluation.pages.sets.get`.
        entries: Who plays, by page; no two of a page share a label.
        out: A folder; the results go into a folder of the set's name therein.
        episodes: As in :func:`plan`.
        options: Of :func:`play`.

    Returns:
        What was measured, by page.

    Raises:
        IkgymError: As in :func:`plan` and :func:`play`; or the file of an agent cannot be used.
    """
    plans = {page: plan(name, some, episodes) for page, some in entries.items()}
    merged = {(page, label): jobs for page, planned in plans.items() for label, jobs in planned.items()}
    rows = play(merged, out / slug(name), **options)
    sections = {}
    for page, some in entries.items():
        # Some play fewer episodes, but not all of them do.
        first = max(plans[page].values(), key=lambda jobs: len({job.seed for job in jobs}))
        sections[page] = Section(
            name=name,
            fingerprint=first[0].fingerprint,
            test_set=first[0].test_set,
            seeds=tuple(dict.fromkeys(job.seed for job in first)),
            lines=tuple(Line.of(one, rows[page, one.label]) for one in some if one.label in plans[page]),
        )
    return sections
