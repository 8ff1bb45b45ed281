"""Plays contenders on a set of episodes, in a folder that may be gone on with: what needs no clock, then what does."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

from baselines.evaluation import test_sets
from baselines.evaluation.machine import describe
from baselines.evaluation.metrics import Row
from baselines.evaluation.plan import Job, Plan, make_plan
from baselines.evaluation.results import Results
from baselines.evaluation.runner import run
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario


class Contender(Protocol):
    """Who takes part: one policy, or several that are one to the reader, such as a policy with several seeds.

    Attributes:
        spec: What to call it; no two share it.
        variants: Name and parameters of each policy.
        timed: Episodes of each that are played alone, with the clock.
    """

    @property
    def spec(self) -> str: ...  # noqa: D102

    @property
    def variants(self) -> Sequence[tuple[str, Mapping[str, Any]]]: ...  # noqa: D102

    @property
    def timed(self) -> int: ...  # noqa: D102


def plan(
    where: str | Scenario, contenders: Iterable[Contender], episodes: int | None = None, *, split: str = "test"
) -> dict[str, list[Job]]:
    """The episodes of each contender, variant by variant; without those that do not suit the scenario.

    Args:
        where: A test set, or a scenario.
        contenders: Who plays.
        episodes: The first so many; if left out all of a test set, and one of a random scenario.
        split: Where the seeds of a random scenario come from; a test set has its own.

    Raises:
        UnknownNameError: There is no such set, scenario, policy or parameter.
        InvalidInputError: A parameter is refused, nobody suits the scenario, or a test set has drifted.
    """
    fixed = where in test_sets.names() if isinstance(where, str) else False
    kind: dict[str, Any] = {"test_sets": (where,)} if fixed else {"episodes": episodes or 1, "split": split}
    places = () if fixed else (where,)
    everyone = list(contenders)
    unsuited = {s.policy for s in make_plan(places, [v for c in everyone for v in c.variants], **kind).skipped}
    out: dict[str, list[Job]] = {}
    for contender in everyone:
        for variant in contender.variants:
            try:
                jobs = make_plan(places, [variant], timed=contender.timed, **kind).jobs[:episodes]
            except InvalidInputError:
                if variant[0] in unsuited:
                    continue
                raise
            # No trajectory log is kept: there are many contenders, and nobody draws them.
            out.setdefault(contender.spec, []).extend(dataclasses.replace(job, first=False) for job in jobs)
    return out


def play(
    plans: Mapping[str, Sequence[Job]],
    folder: pathlib.Path,
    *,
    workers: int = 1,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool = False,
) -> dict[str, list[Row]]:
    """The rows of all jobs. First what needs no clock is played, then, with nothing else under way, what does.

    Args:
        plans: The jobs of each contender.
        folder: For the results.
        workers: Processes for what needs no clock.
        resume: Goes on with what is in the folder.
        overwrite: Overwrites what is in the folder.
        progress: Whether to show bars on stderr.

    Raises:
        ResultsError: The folder cannot be read or written, or is not to be gone on with.
        WorkerError: A worker process has died.
    """
    whole = Plan(tuple({job.key: job for jobs in plans.values() for job in jobs}.values()), ())
    results = Results(folder, whole, describe(), resume=resume, overwrite=overwrite)
    left = [job for job in whole.jobs if not results.done(job)]
    for timed in (False, True):
        part = [job for job in left if job.timed == timed]
        with contextlib.closing(run(part, workers=1 if timed else workers, progress=progress)) as batches:
            for played in batches:
                results.add(played)
    rows = {row.key: row for row in results.rows}
    return {spec: [rows[job.key] for job in jobs] for spec, jobs in plans.items()}
