"""The episodes of a policy in a scenario put together: costs, comparisons with the ideal plant, labels."""

from __future__ import annotations

import collections
import dataclasses
import functools
import math
import operator
import statistics
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from baselines import registry
from baselines.canonical import canonical
from baselines.evaluation.metrics import Row
from baselines.statistics import Spread, geometric_interval, geometric_mean
from baselines.status import Status
from ikgym.exceptions import IkgymError, InvalidInputError


class Paired(NamedTuple):
    """A policy compared with itself on an ideal plant, on the same reset seeds."""

    cost_ratio: float | None  # geometric mean of the cost ratio on the ideal plant; None where it is not known
    mean: float  # geometric mean of the cost divided by that of the same seed on the ideal plant
    low: float  # lower end of its 95 % interval over the seeds
    high: float  # upper end


@dataclasses.dataclass(frozen=True, eq=False)
class Summary:
    """The episodes of one policy in one scenario. Episodes that differ in their noise alone count as one.

    `ideal` has the rows of the same policy with an ideal plant; it is empty if the plant is ideal itself.
    """

    rows: Sequence[Row]
    ideal: Sequence[Row] = ()
    label: str = ""

    @property
    def first(self) -> Row:
        """The row of the first episode."""
        return self.rows[0]

    @functools.cached_property
    def total_cost(self) -> Spread:
        """The total cost."""
        return Spread.of(by_seed(self.rows, _total))

    @functools.cached_property
    def cost_ratio(self) -> Spread | None:
        """The cost ratio; None if that of an episode is not known."""
        if any(row.cost_ratio is None for row in self.rows):
            return None
        return Spread.of(by_seed(self.rows, _ratio))

    @functools.cached_property
    def interval(self) -> tuple[float, float] | None:
        """The 95 % interval of the cost ratio, or of the total cost if the ratio is not known; None if it has none."""
        values = list(by_seed(self.rows, _ratio if self.cost_ratio else _total).values())
        usable = len(values) > 1 and all(0.0 < value < math.inf for value in values)
        return geometric_interval(values) if usable else None

    @functools.cached_property
    def paired(self) -> Paired | None:
        """The comparison with an ideal plant; None without common seeds, or if a cost is 0."""
        costs, plain = by_seed(self.rows, _total), by_seed(self.ideal, _total)
        common = [seed for seed in costs if seed in plain]
        if not common or min(min(plain[seed], costs[seed]) for seed in common) <= 0.0:
            return None
        ratios = [costs[seed] / plain[seed] for seed in common]
        known = [row.cost_ratio for row in self.ideal if row.seed in costs and row.cost_ratio is not None]
        mean = geometric_mean(known) if len(known) == len(common) else None
        return Paired(mean, geometric_mean(ratios), *geometric_interval(ratios))

    @functools.cached_property
    def episodes(self) -> int:
        """Number of episodes."""
        return len({row.seed for row in self.rows})

    @property
    def lost(self) -> int:
        """Number of rows in which the arm was lost."""
        return sum(row.lost for row in self.rows)

    @property
    def followed(self) -> int:
        """Number of rows in which the path was followed."""
        return sum(row.followed for row in self.rows)

    @property
    def stopped(self) -> int | None:
        """Number of rows in which the arm was stopped; None without collisions."""
        return None if self.first.clearance_min is None else sum(row.stopped is not None for row in self.rows)

    @property
    def solver_status(self) -> str:
        """The worst status that the solver reported."""
        return max((row.solver_status for row in self.rows), key=lambda status: Status[status.upper()])

    @property
    def free_timing(self) -> bool:
        """Whether the policy may be later than the reference."""
        return self.first.path_position_error is not None

    @property
    def path_time(self) -> float | None:
        """The longest time to the end of the path, in [s]; None if an episode did not reach it."""
        return None if any(row.path_time is None for row in self.rows) else self.largest("path_time")

    @property
    def reference(self) -> bool:
        """Whether the policy has privileged information."""
        return is_reference(self.first.policy)

    def _values(self, column: str) -> list[Any]:
        return [value for row in self.rows if (value := getattr(row, column)) is not None]

    def mean(self, column: str) -> float:
        """The geometric mean of a column."""
        return geometric_mean(self._values(column))

    def median(self, column: str) -> float | None:
        """The median of a column; None if no episode has a value."""
        return statistics.median(values) if (values := self._values(column)) else None

    def largest(self, column: str) -> float | None:
        """The maximum of a column; None if no episode has a value."""
        return max(self._values(column), default=None)

    def smallest(self, column: str) -> float | None:
        """The minimum of a column; None if no episode has a value."""
        return min(self._values(column), default=None)

    def total(self, column: str) -> int | None:
        """The sum of a column; None if no episode has a value."""
        return sum(values) if (values := self._values(column)) else None


_total: Callable[[Row], float] = operator.attrgetter("total_cost")


def _ratio(row: Row) -> float:
    return row.cost_ratio or 0.0


def by_seed(rows: Iterable[Row], value: Callable[[Row], float]) -> dict[int, float]:
    """A number of each episode: the geometric mean over its noise seeds, by its reset seed."""
    found: dict[int, list[float]] = {}
    for row in rows:
        found.setdefault(row.seed, []).append(value(row))
    return {seed: geometric_mean(values) for seed, values in found.items()}


def summarise(rows: Iterable[Row]) -> list[Summary]:
    """One summary for each policy with its parameters in each scenario, in the order of their first rows.

    Refused where two scenarios share a name, or rows belong to different test sets.
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
    ideal = {
        (group[0].fingerprint, *key[1:]): group
        for key, group in groups.items()
        if group[0].fingerprint == group[0].ideal
    }
    names = _labels([group[0] for group in groups.values()])
    return [
        Summary(
            group,
            () if group[0].fingerprint == group[0].ideal else ideal.get((str(group[0].ideal), *key[1:]), ()),
            name,
        )
        for (key, group), name in zip(groups.items(), names, strict=True)
    ]


def by_scenario(rows: Iterable[Row]) -> dict[str, list[Summary]]:
    """Summaries of each scenario, in the order of the rows."""
    out: dict[str, list[Summary]] = {}
    for summary in summarise(rows):
        out.setdefault(summary.first.scenario, []).append(summary)
    return out


def is_reference(policy: str) -> bool:
    """Whether a policy has privileged information, as far as it is known without importing code of others."""
    try:
        kind = registry.get(policy) if registry.known(policy) else registry.imported(policy)
    except IkgymError:
        return False
    return bool(getattr(kind, "reference", False))


def _labels(rows: Sequence[Row]) -> list[str]:
    """A label for the policy of each row.

    The name, and the parameters that are not at their defaults; if that leaves two policies of a scenario alike, all
    parameters in which they differ.
    """

    def label(row: Row, variants: Sequence[Row]) -> str:
        defaults = _defaults(row.policy)
        parts = [
            f"{name}={f'{value:g}' if isinstance(value, float) else str(value).replace(' ', '')}"
            for name, value in row.parameters.items()
            if any(variant.parameters.get(name) != value for variant in variants) or defaults.get(name, value) != value
        ]
        return row.policy + (f":{','.join(parts)}" if parts else "")

    short = [(row.scenario, label(row, ())) for row in rows]
    taken = collections.Counter(short)
    return [
        label(row, [other for other, name in zip(rows, short, strict=True) if name == mine])
        if taken[mine] > 1
        else mine[1]
        for row, mine in zip(rows, short, strict=True)
    ]


def _defaults(policy: str) -> dict[str, Any]:
    try:
        fields = dataclasses.fields(registry.get(policy))
    except IkgymError:  # of a policy that is not known here
        return {}
    # None often stands for a value that the policy works out itself.
    return {f.name: f.default for f in fields if f.default is not dataclasses.MISSING and f.default is not None}
