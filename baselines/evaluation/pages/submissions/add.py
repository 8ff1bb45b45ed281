"""Scores submissions on the sets of a leaderboard, and adds them to what its page is made from."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Sequence
from typing import Any

from baselines.evaluation.pages.entries import Entry
from baselines.evaluation.pages.measurement import Measurement, Submitted
from baselines.evaluation.pages.renewal import comparable, with_lines
from baselines.evaluation.pages.submissions.check import Submission, check_foresight, submission, taken
from baselines.files import ResultsError

#: The folder with the files of a submission, beside those with its results.
FILES = "files"


def add(
    measurement: Measurement,
    folders: Sequence[pathlib.Path],
    out: pathlib.Path,
    *,
    date: str,
    trust: bool = False,
    overwrite: bool = False,
    **options: Any,
) -> Measurement:
    """The leaderboard with submissions. All of them are checked before the first is played.

    Args:
        measurement: What the page is made from; its first section is the main test set.
        folders: The submissions.
        out: A folder for the files and the results of each.
        date: As YYYY-MM-DD.
        trust: Whether code in the folders may be run.
        overwrite: Replaces a submission of the same name, and its results.
        options: Of :func:`baselines.evaluation.pages.measure.play`.

    Raises:
        ResultsError: A submission is not what it says, breaks a rule, or has the name of somebody else.
        IkgymError: As in :func:`baselines.evaluation.pages.measure.measure`.
    """
    found = [submission(folder, trust=trust) for folder in folders]
    there = [line.label for line in measurement.sections[0].lines]
    mine = [one.name for one in measurement.submissions]
    for one in found:
        _check_name(one, there, mine, overwrite=overwrite)
        there, mine = [*there, one.manifest.name], [name for name in mine if name != one.manifest.name]
    timed = comparable(measurement)
    entries = [one.copied(out / one.digest / FILES).entry(timed=timed) for one in found]
    for one, entry in zip(found, entries, strict=True):
        for section in measurement.sections:
            check_foresight(entry, section.name, len(section.seeds), one.manifest.foresight)
    for one, entry in zip(found, entries, strict=True):
        measurement = _added(measurement, one, entry, out, date=date, overwrite=overwrite, **options)
    return measurement


def _check_name(one: Submission, there: Sequence[str], mine: Sequence[str], *, overwrite: bool) -> None:
    name = one.manifest.name
    if name in mine and not overwrite:
        raise ResultsError(f"{one.folder}: {name!r} is on the page already: replace it by --overwrite.")
    if name not in mine and taken(name, there):
        raise ResultsError(f"{one.folder}: the name {name!r} is taken; expected one of its own.")


def _added(
    measurement: Measurement, one: Submission, entry: Entry, out: pathlib.Path, *, date: str, **options: Any
) -> Measurement:
    sections = with_lines(measurement, [entry], out / one.digest, everywhere=True, **options)
    said = one.manifest
    line = Submitted(said.name, said.authors, said.commands, said.foresight, said.tuned_on, one.digest, date)
    others = tuple(other for other in measurement.submissions if other.name != said.name)
    return dataclasses.replace(measurement, sections=sections, submissions=(*others, line))
