"""What the page is made from, and its file."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any, Self

from baselines.canonical import DIGITS, one_line, rounded, with_list
from baselines.evaluation.metrics import Row
from baselines.evaluation.summary import Summary, by_seed, geometric_interval, geometric_mean
from baselines.files import json_files, write


@dataclasses.dataclass(frozen=True)
class Cell:
    """A policy at a place of the map.

    Args:
        policy: Its name and parameters.
        knowledge: Severity of calibration and camera.
        drives: Severity of lag and delay.
        cost_ratio: Geometric mean over the episodes.
        low: Lower end of its interval of 95 %, over the episodes.
        high: Upper end.
        lost: Share of the episodes in which the arm lost track.
    """

    policy: str
    knowledge: float
    drives: float
    cost_ratio: float
    low: float
    high: float
    lost: float

    @classmethod
    def of(cls, policy: str, place: tuple[float, float], rows: Sequence[Row], bounds: Mapping[int, float]) -> Self:
        """The cell of some episodes.

        Args:
            policy: Its name and parameters.
            place: Both severities.
            rows: What was played.
            bounds: The best known cost of each episode, by its seed.
        """
        ratios = list(by_seed(rows, lambda row: row.total_cost / bounds[row.seed]).values())
        low, high = _ends(geometric_interval(ratios))
        mean, lost = rounded(geometric_mean(ratios), DIGITS), sum(row.lost for row in rows) / len(rows)
        return cls(policy, *place, mean, low, high, lost)


@dataclasses.dataclass(frozen=True)
class Entry:
    """A policy on a test set, beside itself on an ideal plant.

    Args:
        scenario: The test set.
        policy: Its name and parameters.
        reference: Whether it has privileged information.
        episodes: How many, without noise seeds.
        cost_ratio: Geometric mean over the episodes; None where a best known cost is missing.
        interval: Of 95 %, over the episodes.
        lost: Share of the episodes in which the arm lost track, with all noise seeds.
        ideal: Cost ratio of the same policy with an ideal plant; None where that was not played, or is not known.
        paired: Geometric mean of the cost divided by that on the ideal plant with the same seed.
        paired_interval: Of 95 %, over the episodes.
    """

    scenario: str
    policy: str
    reference: bool
    episodes: int
    cost_ratio: float | None
    interval: tuple[float, float] | None
    lost: float
    ideal: float | None
    paired: float | None
    paired_interval: tuple[float, float] | None

    @classmethod
    def of(cls, policy: str, summary: Summary, rows: Sequence[Row], *, reference: bool) -> Self:
        """The entry of a summary, with the rows that it is of."""
        pair, interval = summary.paired, None
        if summary.cost_ratio is not None:
            interval = _ends(geometric_interval(list(by_seed(rows, lambda row: row.cost_ratio or 0.0).values())))
        return cls(
            scenario=summary.scenario,
            policy=policy,
            reference=reference,
            episodes=summary.episodes,
            cost_ratio=None if summary.cost_ratio is None else rounded(summary.cost_ratio.mean, DIGITS),
            interval=interval,
            lost=summary.lost / len(rows),
            ideal=None if pair is None or pair.cost_ratio is None else rounded(pair.cost_ratio, DIGITS),
            paired=None if pair is None else rounded(pair.mean, DIGITS),
            paired_interval=None if pair is None else _ends((pair.low, pair.high)),
        )


@dataclasses.dataclass(frozen=True)
class Effect:
    """What a part of a plant costs a policy where all else is ideal.

    Args:
        policy: What it is called.
        name: Of the effect.
        paired: Geometric mean of the cost divided by that on the ideal plant with the same seed.
        low: Lower end of its interval of 95 %, over the episodes.
        high: Upper end.
        lost: Share of the episodes in which the arm lost track.
    """

    policy: str
    name: str
    paired: float
    low: float
    high: float
    lost: float

    @classmethod
    def of(cls, policy: str, name: str, rows: Sequence[Row], plain: Sequence[Row]) -> Self:
        """The effect, from rows with it and rows with an ideal plant on the same seeds."""
        costs, without = (by_seed(some, lambda row: row.total_cost) for some in (rows, plain))
        ratios = [costs[seed] / without[seed] for seed in costs]
        low, high = _ends(geometric_interval(ratios))
        lost = sum(row.lost for row in rows) / len(rows)
        return cls(policy, name, rounded(geometric_mean(ratios), DIGITS), low, high, lost)


@dataclasses.dataclass(frozen=True)
class Measured:
    """All that the page says.

    Args:
        command: The command that measured it.
        date: When, in UTC.
        machine: On what, see :func:`baselines.evaluation.machine.describe`.
        scenario: The scenario of the map.
        episodes: Episodes of each policy in each cell of the map, the first of the test split.
        references: Policies with privileged information.
        entries: The policies on the test sets.
        cells: The map.
        policies: What policies are called, and what they are: names, with parameters or without.
        effects: What parts of the plant of the map cost, each alone.
    """

    command: str
    date: str
    machine: Mapping[str, Any]
    scenario: str
    episodes: int
    references: tuple[str, ...]
    entries: tuple[Entry, ...]
    cells: tuple[Cell, ...]
    policies: Mapping[str, str] = dataclasses.field(default_factory=dict)
    effects: tuple[Effect, ...] = ()

    def save(self, file: pathlib.Path) -> None:
        """Writes it as JSON, a cell a line.

        Raises:
            ResultsError: The file cannot be written.
        """
        head = {name: value for name, value in vars(self).items() if name != "cells"}
        head |= {name: dict(head[name]) for name in ("machine", "policies")}
        head |= {name: [dataclasses.asdict(one) for one in head[name]] for name in ("entries", "effects")}
        write(
            file, (with_list(head, "cells", [one_line(dataclasses.asdict(one)) for one in self.cells]) + "\n").encode()
        )

    @classmethod
    def load(cls, file: pathlib.Path) -> Self:
        """What :meth:`save` wrote.

        Raises:
            ResultsError: It cannot be read, or is damaged.
        """
        with json_files.reading("what was measured", file):
            return json_files.made(cls, json_files.read(file))


def _ends(interval: tuple[float, float]) -> tuple[float, float]:
    low, high = interval
    return rounded(low, DIGITS), rounded(high, DIGITS)
