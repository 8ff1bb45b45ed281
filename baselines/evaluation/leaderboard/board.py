"""What was measured: lines of costs and errors by seed and episode, and the file that keeps them."""

from __future__ import annotations

import dataclasses
import json
import pathlib
import statistics
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

import numpy as np

from baselines.evaluation.compact import DIGITS, one_line, rounded, with_list
from baselines.evaluation.leaderboard import places
from baselines.evaluation.leaderboard.entries import ENOUGH, FORESIGHT, PAPER, Entry, Training, label
from baselines.evaluation.metrics import Row
from baselines.evaluation.pareto.points import LOST
from baselines.files import ResultsError, write
from baselines.fingerprints import fingerprint
from baselines.oracle import best_known
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray

#: Kinds of lines, in the order of the legend.
AGENT, RESIDUAL, FAR, NEAR, REFERENCE = "agent", "residual agent", "solver with foresight", "solver", "reference"


@dataclasses.dataclass(frozen=True)
class Line:
    """A solver or an agent on a set of episodes.

    Args:
        name: The solver's spec, or the agent's name.
        settings: Parameters that were searched on validation episodes; none for a solver as it is, and for agents.
        preview: Steps ahead that it sees.
        seeds: Seeds of training, or of the policy; none where nothing is drawn at random.
        cost: Total cost of each episode, a row a seed; one row where there is none.
        error: Largest distance from the nominal position in [m], likewise.
        timed: Episodes that were played with the clock.
        time_p50_us: Median of the medians over the calls after the first, in [µs]; None where nothing was timed.
        time_p99_us: Largest 99th percentile of them, in [µs].
        time_first_us: Longest first call, in [µs].
        training: What it has cost to train; None for solvers.
    """

    name: str
    settings: Mapping[str, Any]
    preview: int
    seeds: tuple[int, ...]
    cost: tuple[tuple[float, ...], ...]
    error: tuple[tuple[float, ...], ...]
    timed: int
    time_p50_us: float | None
    time_p99_us: float | None
    time_first_us: float | None
    training: Training | None

    @classmethod
    def of(cls, entry: Entry, rows: Sequence[Row]) -> Self:
        """The line of an entry's rows, seed by seed."""
        count = max(len(entry.seeds), 1)

        def table(numbers: Iterable[float], digits: int) -> tuple[tuple[float, ...], ...]:
            each = [rounded(value, digits) for value in numbers]
            size = len(each) // count
            return tuple(tuple(each[k * size : (k + 1) * size]) for k in range(count))

        def times(name: str, of: Any) -> float | None:
            found = [time for row in rows if (time := getattr(row, name)) is not None]
            return rounded(of(found)) if found else None

        return cls(
            name=entry.name,
            settings=dict(entry.settings),
            preview=max(int(np.max(row.preview)) for row in rows),
            seeds=entry.seeds,
            cost=table((row.total_cost for row in rows), DIGITS),
            error=table((row.position_error_max for row in rows), 4),
            timed=sum(row.time_p50_us is not None for row in rows),
            time_p50_us=times("time_p50_us", statistics.median),
            time_p99_us=times("time_p99_us", max),
            time_first_us=times("time_first_us", max),
            training=entry.training,
        )

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """The line of what :meth:`Board.save` wrote of it."""
        tables = {name: tuple(tuple(row) for row in values[name]) for name in ("cost", "error")}
        given = values["training"]
        training = given and Training(**{**given, **{n: tuple(given[n]) for n in ("steps", "core_minutes")}})
        return cls(**{**values, **tables, "seeds": tuple(values["seeds"]), "training": training})

    @property
    def label(self) -> str:
        """What tells it from all others."""
        return label(self.name, self.settings)

    @property
    def kind(self) -> str:
        """What it is, in words."""
        if self.training is None:
            return NEAR if self.preview <= PAPER else FAR
        return AGENT if self.training.base_policy is None else RESIDUAL

    @property
    def learned(self) -> bool:
        """Whether it was trained."""
        return self.training is not None

    @property
    def benchmark(self) -> bool:
        """Whether it has seeds enough to be more than an anecdote."""
        return not self.learned or len(self.seeds) >= ENOUGH

    def within(self, distance: float) -> float:
        """The share of all runs that never were farther from the nominal position, in [m]."""
        return float(np.mean(np.array(self.error) <= distance))

    @property
    def lost(self) -> int:
        """How many runs lost track."""
        return int((np.array(self.error) > LOST).sum())

    @property
    def runs(self) -> int:
        """Seeds × episodes."""
        return int(np.size(self.cost))


@dataclasses.dataclass(frozen=True)
class Section:
    """A set of episodes and all that was measured on it.

    Args:
        name: One of :func:`baselines.evaluation.leaderboard.places.names`.
        fingerprint: Of the scenario.
        test_set: The digest of the test set; None where it is none.
        seeds: The reset seeds.
        lines: What was measured.
    """

    name: str
    fingerprint: str
    test_set: str | None
    seeds: tuple[int, ...]
    lines: tuple[Line, ...]

    @property
    def best_known(self) -> list[float] | None:
        """The best known cost of each episode; None where one is not known."""
        scenario = places.get(self.name)
        costs = [cost for seed in self.seeds if (cost := best_known.cost(scenario, seed)) is not None]
        return costs if len(costs) == len(self.seeds) else None

    @property
    def reference(self) -> FloatArray:
        """What the costs are stated relative to: the best known ones, else the lowest over the foresight's seeds.

        One seed would not do: even that preset loses track now and then, and all others would seem to excel there.

        Raises:
            InvalidInputError: There is neither.
        """
        if (known := self.best_known) is not None:
            return np.array(known)
        for line in self.lines:
            if line.label == FORESIGHT:
                lowest: FloatArray = np.array(line.cost).min(axis=0)
                return lowest
        raise InvalidInputError(f"{self.name} has no best known costs, and {FORESIGHT} was not played to stand in.")

    def cost_ratios(self) -> dict[str, FloatArray]:
        """The cost of each line relative to the reference, by its label. Shape (s, e) each."""
        reference = self.reference
        return {line.label: np.array(line.cost) / reference for line in self.lines}

    @property
    def stale(self) -> bool:
        """Whether the scenario, or the cost, is no longer what was measured."""
        return fingerprint(places.get(self.name)) != self.fingerprint


@dataclasses.dataclass(frozen=True)
class Board:
    """The leaderboard.

    Args:
        command: What measured it.
        date: When, as YYYY-MM-DD.
        machine: On what, see :func:`baselines.evaluation.machine.describe`.
        sections: The test set first, then the changed scenarios.
    """

    command: str
    date: str
    machine: Mapping[str, Any]
    sections: tuple[Section, ...]

    def save(self, file: pathlib.Path) -> None:
        """Writes it as JSON, a line of the leaderboard a line.

        Raises:
            ResultsError: The file cannot be written.
        """
        head = {"command": self.command, "date": self.date, "machine": dict(self.machine)}
        sections = []
        for one in self.sections:
            about = {name: value for name, value in vars(one).items() if name != "lines"}
            sections.append(with_list(about, "lines", [one_line(dataclasses.asdict(line)) for line in one.lines]))
        write(file, (with_list(head, "sections", sections) + "\n").encode())

    @classmethod
    def load(cls, file: pathlib.Path) -> Self:
        """What :meth:`save` wrote.

        Raises:
            ResultsError: It cannot be read, or is damaged.
        """
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
            sections = [
                Section(**{**one, "seeds": tuple(one["seeds"]), "lines": tuple(map(Line.from_json, one["lines"]))})
                for one in content["sections"]
            ]
            return cls(**{**content, "sections": tuple(sections)})
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as e:
            raise ResultsError(f"Cannot read what was measured from {file}: {e!r}.") from None
