"""Plays single lines of a leaderboard, beside the others, which stay as they were measured."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Sequence
from typing import Any

from baselines.evaluation.machine import describe
from baselines.evaluation.pages.entries import Entry, playing
from baselines.evaluation.pages.measure import measure
from baselines.evaluation.pages.measurement import Measurement, Renewal, Section
from baselines.files import ResultsError
from ikgym.exceptions import UnknownNameError


def renewed(
    measurement: Measurement,
    entries: Sequence[Entry],
    labels: Sequence[str],
    out: pathlib.Path,
    *,
    command: str,
    date: str,
    **options: Any,
) -> Measurement:
    """The leaderboard with some lines played anew, or for the first time.

    Args:
        measurement: What the page is made from; its first section is the main test set.
        entries: Who could play.
        labels: Who of them does.
        out: A folder for the results.
        command: What has been asked for.
        date: As YYYY-MM-DD.
        options: Of :func:`baselines.evaluation.pages.measure.play`.

    Raises:
        UnknownNameError: Nobody of that label could play; the message has the nearest one.
        IkgymError: As in :func:`baselines.evaluation.pages.measure.measure`.
    """
    known = {entry.label: entry for entry in entries}
    for label in labels:
        if label not in known:
            raise UnknownNameError("line of a leaderboard", label, sorted(known))
    chosen = [known[label] for label in dict.fromkeys(labels)]
    if not comparable(measurement):
        chosen = [dataclasses.replace(entry, timed=0) for entry in chosen]
    sections = with_lines(measurement, chosen, out, **options)
    before = (
        dataclasses.replace(one, labels=tuple(label for label in one.labels if label not in labels))
        for one in measurement.renewals
    )
    own = Renewal(tuple(entry.label for entry in chosen), command, date)
    renewals = *(one for one in before if one.labels), own
    return dataclasses.replace(measurement, sections=sections, renewals=renewals)


def comparable(measurement: Measurement) -> bool:
    """Whether this is the machine of a page: times of another one must not stand beside its own."""
    return dict(measurement.machine) == describe()


def with_lines(
    measurement: Measurement, entries: Sequence[Entry], out: pathlib.Path, *, everywhere: bool = False, **options: Any
) -> tuple[Section, ...]:
    """The sections of a leaderboard with lines of these entries, in place of any of the same labels.

    Args:
        measurement: The leaderboard.
        entries: Who plays.
        out: A folder for the results.
        everywhere: Whether all of them play all sections, rather than those that the others of their kind play.
        options: Of :func:`baselines.evaluation.pages.measure.play`.

    Raises:
        ResultsError: The scenario of a section, or its episodes, have changed since it was measured.
        IkgymError: As in :func:`baselines.evaluation.pages.measure.measure`.
    """
    main = measurement.sections[0].name
    untimed = [dataclasses.replace(entry, timed=0) for entry in entries]
    sections = []
    for section in measurement.sections:
        own = playing(section.name, entries, main)
        if everywhere and section.name != main:
            own = untimed
        sections.append(_with(section, own, out, options) if own else section)
    return tuple(sections)


def _with(section: Section, entries: Sequence[Entry], out: pathlib.Path, options: dict[str, Any]) -> Section:
    """A section with these lines, played on its very episodes."""
    played = measure(section.name, {"": entries}, out, episodes=len(section.seeds), **options)[""]
    if (played.seeds, played.fingerprint) != (section.seeds, section.fingerprint):
        raise ResultsError(f"{section.name}: expected the episodes of the page, {section.seeds}, got {played.seeds}.")
    labels = {entry.label for entry in entries}
    others = tuple(line for line in section.lines if line.label not in labels)
    return dataclasses.replace(section, lines=(*others, *played.lines))
