"""What was measured: for each set of episodes one point a contender, and the points that nobody beats."""

from __future__ import annotations

import dataclasses
import json
import pathlib
import statistics
from collections.abc import Mapping, Sequence
from typing import Any, Self

from baselines.evaluation.compact import DIGITS, one_line, rounded, with_list
from baselines.evaluation.metrics import Row, Spread
from baselines.files import ResultsError, write
from baselines.fingerprints import fingerprint
from baselines.oracle import best_known
from ikgym import scenarios

#: An arm that was farther from its nominal position than this has lost track, in [m].
LOST = 0.05


@dataclasses.dataclass(frozen=True)
class Point:
    """A contender on a set.

    Args:
        spec: The contender.
        cost: Total cost of each episode: all episodes of the set with the first seed of the policy, then with the next.
        lost: How many of them lost track.
        timed: How many were played with the clock.
        time_p50_us: Median of the medians over the calls after the first, in [µs].
        time_p99_us: Largest 99th percentile of them, in [µs].
        time_first_us: Longest first call, in [µs].
    """

    spec: str
    cost: tuple[float, ...]
    lost: int
    timed: int
    time_p50_us: float
    time_p99_us: float
    time_first_us: float

    @classmethod
    def of(cls, spec: str, rows: Sequence[Row]) -> Self:
        """The point of a contender's rows, of which one at least was timed."""

        def times(name: str) -> list[float]:
            return [time for row in rows if (time := getattr(row, name)) is not None]

        return cls(
            spec=spec,
            cost=tuple(rounded(row.total_cost, DIGITS) for row in rows),
            lost=sum(row.position_error_max > LOST for row in rows),
            timed=len(times("time_p50_us")),
            time_p50_us=rounded(statistics.median(times("time_p50_us"))),
            time_p99_us=rounded(max(times("time_p99_us"))),
            time_first_us=rounded(max(times("time_first_us"))),
        )


@dataclasses.dataclass(frozen=True)
class Measured:
    """A set of episodes and all that was measured on it.

    Args:
        name: Of the scenario, or of the test set.
        fingerprint: Of the scenario.
        seeds: The reset seeds.
        points: One a contender.
    """

    name: str
    fingerprint: str
    seeds: tuple[int, ...]
    points: tuple[Point, ...]

    def best_known(self) -> list[float] | None:
        """The best known cost of each episode; None where one is not known."""
        scenario = scenarios.get(self.name)
        known = [best_known.cost(scenario, seed) for seed in self.seeds]
        costs = [cost for cost in known if cost is not None]
        return costs if len(costs) == len(known) else None

    def spreads(self) -> dict[str, Spread]:
        """The cost ratio of each contender over all of its episodes; the cost where a best known cost is missing."""
        known = self.best_known() or [1.0] * len(self.seeds)
        return {
            point.spec: Spread.of({i: cost / known[i % len(known)] for i, cost in enumerate(point.cost)})
            for point in self.points
        }

    @property
    def stale(self) -> bool:
        """Whether the scenario, or the cost, is no longer what was measured."""
        return fingerprint(scenarios.get(self.name)) != self.fingerprint


@dataclasses.dataclass(frozen=True)
class Measurement:
    """All sets, and how they were measured.

    Args:
        command: What measured them.
        date: When, as YYYY-MM-DD.
        machine: On what, see :func:`baselines.evaluation.machine.describe`.
        sets: What came out.
    """

    command: str
    date: str
    machine: Mapping[str, Any]
    sets: tuple[Measured, ...]

    def save(self, file: pathlib.Path) -> None:
        """Writes it as JSON, a point a line.

        Raises:
            ResultsError: The file cannot be written.
        """
        head = {"command": self.command, "date": self.date, "machine": dict(self.machine)}
        sets = []
        for one in self.sets:
            about = {"name": one.name, "fingerprint": one.fingerprint, "seeds": one.seeds}
            sets.append(with_list(about, "points", [one_line(dataclasses.asdict(point)) for point in one.points]))
        write(file, (with_list(head, "sets", sets) + "\n").encode())

    @classmethod
    def load(cls, file: pathlib.Path) -> Self:
        """What :meth:`save` wrote.

        Raises:
            ResultsError: It cannot be read, or is damaged.
        """
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
            sets = [
                Measured(
                    **{
                        **one,
                        "seeds": tuple(one["seeds"]),
                        "points": tuple(Point(**{**p, "cost": tuple(p["cost"])}) for p in one["points"]),
                    }
                )
                for one in content["sets"]
            ]
            return cls(**{**content, "sets": tuple(sets)})
        except (OSError, ValueError, TypeError, KeyError) as e:
            raise ResultsError(f"Cannot read what was measured from {file}: {e!r}.") from None


def front(one: Measured, time: str = "time_p50_us") -> list[str]:
    """The contenders that no other beats in time or cost ratio without being worse in the other, from fast to slow.

    Args:
        one: A set.
        time: Which of a point's times.
    """
    means = {spec: spread.mean for spec, spread in one.spreads().items()}
    out: list[str] = []
    for point in sorted(one.points, key=lambda point: (getattr(point, time), means[point.spec])):
        if not out or means[point.spec] < means[out[-1]]:
            out.append(point.spec)
    return out
