"""Plays who is on the leaderboard, each set of episodes in a folder of results that may be gone on with."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Sequence

from baselines.evaluation import contest
from baselines.evaluation.leaderboard import places
from baselines.evaluation.leaderboard.board import Line, Section
from baselines.evaluation.leaderboard.entries import Entry
from baselines.evaluation.plan import Job
from baselines.evaluation.results import slug
from ikgym.exceptions import InvalidInputError


def plan(name: str, entries: Sequence[Entry], episodes: int | None = None) -> dict[str, list[Job]]:
    """The episodes of each entry.

    Args:
        name: One of :func:`places.names`. On the main one everybody plays, and some episodes
            with the clock; on the others agents and some solvers, without.
        entries: Who plays.
        episodes: The first so many; all of the test set, and 32 of a changed scenario, if left out.

    Raises:
        UnknownNameError: There is no such place, policy or parameter.
        InvalidInputError: A parameter is refused, somebody does not suit the place, or the test set has drifted.
    """
    scenario = places.get(name)
    if name == places.MAIN:
        plans = contest.plan(name, entries, episodes)
    else:
        there = [entry for entry in entries if entry.general]
        untimed = contest.plan(scenario, there, episodes or places.EPISODES).items()
        plans = {spec: [dataclasses.replace(job, timed=False) for job in jobs] for spec, jobs in untimed}
    if missing := [entry.spec for entry in entries if entry.training and entry.spec not in plans]:
        raise InvalidInputError(f"{', '.join(missing)}: made for another task or arm than that of {name}.")
    return plans


def measure(
    name: str,
    entries: Sequence[Entry],
    out: pathlib.Path,
    *,
    episodes: int | None = None,
    workers: int = 1,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool = False,
) -> Section:
    """Plays one set of episodes.

    Args:
        name: As in :func:`plan`, like the next.
        entries: Who plays; no two share a label.
        out: A folder; the results go into a folder of the set's name therein.
        episodes: As in :func:`plan`.
        workers: Processes for what needs no clock.
        resume: Goes on with what is in the folder.
        overwrite: Throws away what is in the folder.
        progress: Whether to show bars on stderr.

    Raises:
        UnknownNameError: As in :func:`plan`, like the next.
        InvalidInputError: See above.
        ResultsError: The folder cannot be read or written, or is not to be gone on with; the file of an agent cannot be
            used.
        WorkerError: A worker process has died.
    """
    plans = plan(name, entries, episodes)
    folder = out / slug(name)
    rows = contest.play(plans, folder, workers=workers, resume=resume, overwrite=overwrite, progress=progress)
    by_spec = {entry.spec: entry for entry in entries}
    first = next(iter(plans.values()))
    return Section(
        name=name,
        fingerprint=first[0].fingerprint,
        test_set=first[0].test_set,
        seeds=tuple(dict.fromkeys(job.seed for job in first)),
        lines=tuple(Line.of(by_spec[spec], found) for spec, found in rows.items()),
    )
