"""The rows of several episodes put together."""

from __future__ import annotations

import dataclasses
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from baselines.canonical import canonical
from baselines.evaluation.metrics import Row
from baselines.evaluation.statistics import geometric_interval as geometric_interval
from baselines.evaluation.statistics import geometric_mean as geometric_mean
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray


@dataclasses.dataclass(frozen=True)
class Spread:
    """A number over several episodes.

    Args:
        mean: Its geometric mean.
        median: Its median.
        p90: Its 90th percentile.
        worst: The largest.
        worst_seed: The reset seed of the episode with the largest.
    """

    mean: float
    median: float
    p90: float
    worst: float
    worst_seed: int

    @classmethod
    def of(cls, values: Mapping[int, float]) -> Self:
        """The spread of numbers by their reset seeds."""
        numbers, seed = list(values.values()), max(values, key=lambda seed: values[seed])
        p90 = float(np.percentile(numbers, 90))
        return cls(geometric_mean(numbers), statistics.median(numbers), p90, values[seed], seed)

    @classmethod
    def over(cls, values: FloatArray) -> Self:
        """The spread of numbers that belong to no single episode, such as those of several seeds of a policy."""
        return cls.of(dict(enumerate(np.ravel(values).tolist())))


class Paired(NamedTuple):
    """A policy beside itself on an ideal plant, on the same reset seeds.

    Attributes:
        ideal: Geometric mean of the total cost on the ideal plant.
        cost_ratio: Geometric mean of the cost ratio there; None where it is not known.
        mean: Geometric mean of the cost divided by that of the same seed on the ideal plant.
        low: Lower end of its interval of 95 %, over the seeds.
        high: Upper end.
        episodes: Seeds that both have played.
    """

    ideal: float
    cost_ratio: float | None
    mean: float
    low: float
    high: float
    episodes: int


@dataclasses.dataclass(frozen=True)
class Summary:
    """The episodes of one policy in one scenario, put together.

    Args:
        scenario: Its name.
        policy: Its name.
        parameters: The policy's parameters.
        steps: Steps of an episode.
        episodes: How many there are; those that differ in their noise alone are one.
        total_cost: Over the episodes.
        tracking_cost: Geometric mean.
        velocity_cost: Geometric mean.
        cost_ratio: Over the episodes; None where one is not known.
        position_error_max: The largest, in [m].
        orientation_error_max: The largest, in [rad]; None without an orientation.
        qdot_peak: The largest, in [rad/s] or [m/s].
        steps_at_joint_limit: Their sum.
        steps_at_velocity_limit: Likewise.
        steps_at_acceleration_limit: Likewise.
        time_p50_us: Median of the medians, in [µs]; None, like all times, where no episode was timed.
        time_p99_us: The largest, in [µs].
        deadline_misses: Their sum.
        status: The worst.
        time_first_us: The largest, in [µs].
        lost: In how many the arm lost track, see :func:`baselines.evaluation.metrics.lost`; each noise seed counts.
        paired: The policy beside itself on an ideal plant; None where the plant is ideal, or it has not played there.
    """

    scenario: str
    policy: str
    parameters: dict[str, Any]
    steps: int
    episodes: int
    total_cost: Spread
    tracking_cost: float
    velocity_cost: float
    cost_ratio: Spread | None
    position_error_max: float
    orientation_error_max: float | None
    qdot_peak: float
    steps_at_joint_limit: int
    steps_at_velocity_limit: int
    steps_at_acceleration_limit: int
    time_p50_us: float | None
    time_p99_us: float | None
    deadline_misses: int | None
    status: str
    time_first_us: float | None
    lost: int
    paired: Paired | None = None


class Times(NamedTuple):
    """Times of single calls over those of several episodes that were timed; None where none was.

    Attributes:
        timed: How many episodes were timed.
        p50_us: Median of the medians, in [µs].
        p99_us: The largest, in [µs].
        first_us: The longest first call, in [µs].
    """

    timed: int
    p50_us: float | None
    p99_us: float | None
    first_us: float | None


def times(rows: Iterable[Row]) -> Times:
    """The times of some rows, put together."""
    timed = [row for row in rows if row.time_p50_us is not None]
    medians = [row.time_p50_us for row in timed if row.time_p50_us is not None]
    return Times(
        len(timed),
        statistics.median(medians) if medians else None,
        max((row.time_p99_us for row in timed if row.time_p99_us is not None), default=None),
        max((row.time_first_us for row in timed if row.time_first_us is not None), default=None),
    )


def summarise(rows: Iterable[Row]) -> list[Summary]:
    """One summary for each policy with its parameters in each scenario, in the order of their first rows.

    Raises:
        InvalidInputError: Rows cannot be compared: their scenarios share a name and no more, or they belong to
            different sets.
    """
    groups: dict[tuple[str, str, str, int], list[Row]] = {}
    contents: dict[str, tuple[str, str | None]] = {}
    for row in rows:
        content = row.fingerprint, row.test_set
        if contents.setdefault(row.scenario, content) != content:
            raise InvalidInputError(
                f"The results of {row.scenario!r} cannot be put together: fingerprint and test set are "
                f"{contents[row.scenario]} and {content}."
            )
        groups.setdefault((row.scenario, row.policy, canonical(row.parameters), row.steps), []).append(row)
    on_ideal = {
        (group[0].fingerprint, *key[1:]): group
        for key, group in groups.items()
        if group[0].fingerprint == group[0].ideal
    }
    return [_summary(group, on_ideal.get((str(group[0].ideal), *key[1:]))) for key, group in groups.items()]


def by_seed(rows: Iterable[Row], value: Callable[[Row], float]) -> dict[int, float]:
    """A number of each episode: the geometric mean over its noise seeds, by its reset seed."""
    found: dict[int, list[float]] = {}
    for row in rows:
        found.setdefault(row.seed, []).append(value(row))
    return {seed: geometric_mean(values) for seed, values in found.items()}


def paired(rows: Sequence[Row], ideal: Sequence[Row]) -> Paired | None:
    """A policy beside itself on an ideal plant; None where they have no seed in common, or a cost is 0."""
    costs, plain = by_seed(rows, _total), by_seed(ideal, _total)
    common = [seed for seed in costs if seed in plain]
    if not common or min(plain[seed] for seed in common) <= 0.0 or min(costs[seed] for seed in common) <= 0.0:
        return None
    ratios = [costs[seed] / plain[seed] for seed in common]
    known = [row.cost_ratio for row in ideal if row.seed in costs and row.cost_ratio is not None]
    return Paired(
        geometric_mean([plain[seed] for seed in common]),
        geometric_mean(known) if len(known) == len(common) else None,
        geometric_mean(ratios),
        *geometric_interval(ratios),
        len(common),
    )


def _total(row: Row) -> float:
    return row.total_cost


def _summary(rows: Sequence[Row], ideal: Sequence[Row] | None) -> Summary:
    first = rows[0]
    costs = by_seed(rows, _total)
    known = all(row.cost_ratio is not None for row in rows)
    angles = [row.orientation_error_max for row in rows if row.orientation_error_max is not None]
    clocked = times(rows)
    misses = [row.deadline_misses for row in rows if row.deadline_misses is not None]
    return Summary(
        scenario=first.scenario,
        policy=first.policy,
        parameters=first.parameters,
        steps=first.steps,
        episodes=len(costs),
        total_cost=Spread.of(costs),
        tracking_cost=geometric_mean([row.tracking_cost for row in rows]),
        velocity_cost=geometric_mean([row.velocity_cost for row in rows]),
        cost_ratio=Spread.of(by_seed(rows, lambda row: row.cost_ratio or 0.0)) if known else None,
        position_error_max=max(row.position_error_max for row in rows),
        orientation_error_max=max(angles) if angles else None,
        qdot_peak=max(row.qdot_peak for row in rows),
        steps_at_joint_limit=sum(row.steps_at_joint_limit for row in rows),
        steps_at_velocity_limit=sum(row.steps_at_velocity_limit for row in rows),
        steps_at_acceleration_limit=sum(row.steps_at_acceleration_limit for row in rows),
        time_p50_us=clocked.p50_us,
        time_p99_us=clocked.p99_us,
        deadline_misses=sum(misses) if misses else None,
        status=max((row.status for row in rows), key=lambda status: Status[status.upper()]),
        time_first_us=clocked.first_us,
        lost=sum(row.lost for row in rows),
        paired=None if ideal is None or first.fingerprint == first.ideal else paired(rows, ideal),
    )
