"""Plays the contenders on sets of episodes, each set in a folder of results that may be gone on with."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable

from baselines.evaluation.contest import plan, play
from baselines.evaluation.pareto.contenders import Contender
from baselines.evaluation.pareto.points import Measured, Point
from baselines.evaluation.results import slug
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
        name: A test set, or a scenario.
        contenders: Who plays; those that do not suit the scenario are left out.
        out: A folder; the results go into a folder of the set's name therein.
        episodes: The first so many of the set, for trials.
        workers: Processes for what needs no clock.
        resume: Goes on with what is in the folder.
        overwrite: Throws away what is in the folder.
        progress: Whether to show bars on stderr.

    Raises:
        UnknownNameError: There is no such set or scenario.
        InvalidInputError: A test set has drifted.
        ResultsError: The folder cannot be read or written, or is not to be gone on with.
        WorkerError: A worker process has died.
    """
    plans = plan(name, contenders, episodes)
    rows = play(plans, out / slug(name), workers=workers, resume=resume, overwrite=overwrite, progress=progress)
    first = next(iter(plans.values()))
    return Measured(
        name=name,
        fingerprint=first[0].fingerprint,
        seeds=tuple(dict.fromkeys(job.seed for job in first)),
        points=tuple(Point.of(spec, found) for spec, found in rows.items()),
    )
