"""The numbers that an episode is judged by, and how those of several episodes are put together."""

from __future__ import annotations

import collections
import dataclasses
import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from baselines.canonical import canonical
from baselines.episode import added_up
from baselines.evaluation.rollout import Episode
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: The columns that are measured with a clock, and so differ from run to run.
TIME_COLUMNS = ("time_first_us", "time_p50_us", "time_p99_us", "deadline_misses")


@dataclasses.dataclass(frozen=True)
class Row:
    """The result of one episode.

    Where a scenario holds its nominal points for several steps, costs and errors are those of the steps that
    count, see :meth:`ikgym.Scenario.counted`; all else is over all steps.

    Args:
        scenario: Its name.
        policy: Its name.
        parameters: All parameters of the policy, but for the seed of a reference.
        seed: The reset seed.
        steps: Steps of the episode.
        total_cost: Sum of −reward, added up step by step.
        tracking_cost: The part Φ^X.
        velocity_cost: The part Φ^U.
        cost_ratio: total_cost / best known cost, see :mod:`baselines.oracle.best_known`; None where there is none.
        position_error_max: Largest distance from the nominal position, in [m].
        position_error_rms: Its root mean square over the steps, in [m].
        orientation_error_max: Largest geodesic angle to the nominal orientation, in [rad]; None without one.
        orientation_error_rms: Its root mean square over the steps, in [rad]; None without an orientation.
        qdot_peak: Largest absolute joint velocity, in [rad/s] or [m/s].
        qdot_rms: Root mean square over steps and joints, in [rad/s] or [m/s].
        qdot_total_variation: Σ_k Σ_j |q̇_j(k+1) − q̇_j(k)|, in [rad/s] or [m/s].
        time_p50_us: Median wall time of one call of the policy, in [µs], over all but the first, which often does more
            than the others (and is taken only where there is no other). None, like all times, where the episode was
            played together with others.
        time_p99_us: Its 99th percentile, in [µs].
        deadline_misses: Calls, but for the first, that took longer than the scenario's Δt.
        status: The worst status of the episode; unknown of policies that say nothing of themselves.
        machine: What it ran on, see :func:`baselines.evaluation.machine.describe`.
        iterations: Mean iterations of the policy in one step; None where they are not known.
        status_counts: How many steps ended with which status.
        preview: Steps ahead that the policy was shown; the furthest where it was shown some of them.
        fingerprint: Tells scenarios apart that share a name, see :func:`baselines.fingerprints.fingerprint`.
        operations: Mean numbers of operations in one step, see :class:`baselines.policy.Operations`; empty where they
            are not known.
        time_first_us: Wall time of the first call of the policy, in [µs].
        test_set: The digest of the test set that the episode belongs to, see :mod:`baselines.evaluation.test_sets`.
    """

    scenario: str
    policy: str
    parameters: dict[str, Any]
    seed: int
    steps: int
    total_cost: float
    tracking_cost: float
    velocity_cost: float
    cost_ratio: float | None
    position_error_max: float
    position_error_rms: float
    orientation_error_max: float | None
    orientation_error_rms: float | None
    qdot_peak: float
    qdot_rms: float
    qdot_total_variation: float
    time_p50_us: float | None
    time_p99_us: float | None
    deadline_misses: int | None
    status: str
    machine: dict[str, Any]
    iterations: float | None
    status_counts: dict[str, int]
    preview: int
    fingerprint: str
    operations: dict[str, float]
    time_first_us: float | None
    test_set: str | None

    @property
    def key(self) -> tuple[str, str, str, int, int]:
        """What says which episode of an evaluation this is."""
        return key(self.scenario, self.policy, self.parameters, self.seed, self.steps)

    def to_json(self) -> dict[str, Any]:
        """The row as JSON has it: numbers that are not finite are null."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {name: _finite_or_none(value) for name, value in values.items()}

    @classmethod
    def from_json(cls, values: object) -> Self:
        """The row that :meth:`to_json` gave.

        Raises:
            InvalidInputError: A key is missing, is one too many, or has a value of a wrong type.
        """
        if not isinstance(values, Mapping):
            raise InvalidInputError(f"expected an object with the keys of a row, got {type(values).__name__}")
        types = {field.name: str(field.type) for field in dataclasses.fields(cls)}
        if missing := [name for name in types if name not in values]:
            raise InvalidInputError(f"the key {missing[0]!r} is missing")
        if unknown := [name for name in values if name not in types]:
            raise InvalidInputError(f"there is a key {unknown[0]!r} that no row has")
        return cls(**{name: _typed(name, types[name], values[name]) for name in types})


def key(
    scenario: str, policy: str, parameters: Mapping[str, Any], seed: int, steps: int
) -> tuple[str, str, str, int, int]:
    """What says which episode of an evaluation is meant; two are the same where their keys are."""
    return scenario, policy, canonical(parameters), seed, steps


def measure(
    scenario: Scenario,
    policy: str,
    parameters: Mapping[str, Any],
    seed: int,
    episode: Episode,
    *,
    machine: Mapping[str, Any],
    preview: int,
    fingerprint: str,
    test_set: str | None = None,
    best_known: float | None = None,
) -> Row:
    """The row of a recorded episode; see :class:`Row`; the cost ratio is stated against `best_known`."""
    total = float(added_up(episode.tracking_cost + episode.velocity_cost))
    timed, later = len(episode.time_ns) > 0, episode.time_ns[1:] if len(episode.time_ns) > 1 else episode.time_ns
    counted = scenario.counted()[1:]
    angles = episode.orientation_error[counted] if scenario.task.has_orientation else None
    statuses = collections.Counter(episode.status.tolist())
    worst, operations = Status(max(statuses)), episode.operations._asdict()
    return Row(
        scenario=scenario.name,
        policy=policy,
        parameters=dict(parameters),
        seed=seed,
        steps=scenario.steps,
        total_cost=total,
        tracking_cost=float(added_up(episode.tracking_cost)),
        velocity_cost=float(added_up(episode.velocity_cost)),
        cost_ratio=None if best_known is None else total / best_known,
        position_error_max=float(episode.position_error[counted].max()),
        position_error_rms=_rms(episode.position_error[counted]),
        orientation_error_max=None if angles is None else float(angles.max()),
        orientation_error_rms=None if angles is None else _rms(angles),
        qdot_peak=float(np.abs(episode.qdot).max()),
        qdot_rms=_rms(episode.qdot),
        qdot_total_variation=float(np.abs(np.diff(episode.qdot, axis=0)).sum()),
        time_p50_us=float(np.percentile(later, 50)) / 1e3 if timed else None,
        time_p99_us=float(np.percentile(later, 99)) / 1e3 if timed else None,
        deadline_misses=int((later > 1e9 * scenario.dt).sum()) if timed else None,
        status=worst.label,
        machine=dict(machine),
        iterations=None if worst is Status.UNKNOWN else float(episode.iterations.mean()),
        status_counts={Status(status).label: count for status, count in sorted(statuses.items())},
        preview=preview,
        fingerprint=fingerprint,
        operations={name: float(count.mean()) for name, count in operations.items() if len(count)},
        time_first_us=float(episode.time_ns[0]) / 1e3 if timed else None,
        test_set=test_set,
    )


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


@dataclasses.dataclass(frozen=True)
class Summary:
    """The episodes of one policy in one scenario, put together.

    Args:
        scenario: Its name.
        policy: Its name.
        parameters: The policy's parameters.
        steps: Steps of an episode.
        episodes: How many there are.
        total_cost: Over the episodes.
        tracking_cost: Geometric mean.
        velocity_cost: Geometric mean.
        cost_ratio: Over the episodes; None where one is not known.
        position_error_max: The largest, in [m].
        orientation_error_max: The largest, in [rad]; None without an orientation.
        qdot_peak: The largest, in [rad/s] or [m/s].
        time_p50_us: Median of the medians, in [µs]; None, like all times, where no episode was timed.
        time_p99_us: The largest, in [µs].
        deadline_misses: Their sum.
        status: The worst.
        operations: Means over the episodes; empty where they are not known.
        time_first_us: The largest, in [µs].
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
    time_p50_us: float | None
    time_p99_us: float | None
    deadline_misses: int | None
    status: str
    operations: dict[str, float]
    time_first_us: float | None


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
    return [_summary(group) for group in groups.values()]


def geometric_mean(values: Sequence[float]) -> float:
    """Exp of the mean logarithm; 0 where a value is 0."""
    if min(values) <= 0.0:
        return 0.0
    return values[0] if len(values) == 1 else math.exp(math.fsum(map(math.log, values)) / len(values))


def _summary(rows: Sequence[Row]) -> Summary:
    first = rows[0]
    cost_ratios = {row.seed: row.cost_ratio for row in rows if row.cost_ratio is not None}
    angles = [row.orientation_error_max for row in rows if row.orientation_error_max is not None]
    clocked = times(rows)
    misses = [row.deadline_misses for row in rows if row.deadline_misses is not None]
    return Summary(
        scenario=first.scenario,
        policy=first.policy,
        parameters=first.parameters,
        steps=first.steps,
        episodes=len(rows),
        total_cost=Spread.of({row.seed: row.total_cost for row in rows}),
        tracking_cost=geometric_mean([row.tracking_cost for row in rows]),
        velocity_cost=geometric_mean([row.velocity_cost for row in rows]),
        cost_ratio=Spread.of(cost_ratios) if len(cost_ratios) == len(rows) else None,
        position_error_max=max(row.position_error_max for row in rows),
        orientation_error_max=max(angles) if angles else None,
        qdot_peak=max(row.qdot_peak for row in rows),
        time_p50_us=clocked.p50_us,
        time_p99_us=clocked.p99_us,
        deadline_misses=sum(misses) if misses else None,
        status=max((row.status for row in rows), key=lambda status: Status[status.upper()]),
        operations={name: statistics.fmean(row.operations[name] for row in rows) for name in first.operations},
        time_first_us=clocked.first_us,
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _finite_or_none(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _typed(name: str, kind: str, value: Any) -> Any:
    """A value of JSON as the field's type, or words that say why not."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    right = {
        "str": isinstance(value, str),
        "int": isinstance(value, int) and number,
        "float": number or value is None,
        "float | None": number or value is None,
        "int | None": value is None or (isinstance(value, int) and number),
        "str | None": value is None or isinstance(value, str),
    }.get(kind, isinstance(value, dict))
    if not right or (name == "status" and value.upper() not in Status.__members__):
        raise InvalidInputError(f"the key {name!r} should have a value of type {kind}, got {value!r}")
    if kind.startswith("float") and value is not None:
        return float(value)
    return math.nan if kind == "float" and value is None else value
