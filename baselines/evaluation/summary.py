"""The episodes of a policy in a scenario as one record, which is a line of all tables of results."""

from __future__ import annotations

import collections
import dataclasses
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from baselines import registry
from baselines.canonical import canonical
from baselines.evaluation.metrics import Row
from baselines.statistics import geometric_interval, geometric_mean
from baselines.status import Status
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.scenarios.preview import furthest
from ikgym.validation import FloatArray

#: One line of a table: the name of each column and its value. Names end with the unit, such as `time_p50_us`.
Record = Mapping[str, Any]
#: The quantities by which the episodes of a scenario are compared.
RATIO, TOTAL = "cost ratio", "total cost"


def grouped(rows: Iterable[Row]) -> dict[tuple[str, str, str, int], list[Row]]:
    """The rows of each policy with its parameters in each scenario, in the order of their first rows.

    Raises:
        InvalidInputError: Two scenarios share a name, or rows belong to different test sets.
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
    return groups


def summarise(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """One record for each group of rows, see :func:`grouped` and :func:`record`.

    Besides: `quantity`, by which the episodes are compared: it is the cost ratio if all of the scenario are known;
    `cost_ratio` of the policy, None if it is not known; `ideal_cost_ratio`, its cost ratio on an ideal plant; and
    `times_ideal`, the geometric mean of its cost divided by that of the same seed there, with its interval.
    """
    groups = grouped(rows)
    unknown = {row.scenario for group in groups.values() for row in group if row.cost_ratio is None}
    ideal = {
        (group[0].fingerprint, *key[1:]): group
        for key, group in groups.items()
        if group[0].fingerprint == group[0].ideal
    }
    out = []
    for (key, group), label in zip(groups.items(), labels([group[0] for group in groups.values()]), strict=True):
        first, values = group[0], by_seed(group, _total if key[0] in unknown else _ratio)
        known = all(row.cost_ratio is not None for row in group)
        plain = [] if first.fingerprint == first.ideal else ideal.get((str(first.ideal), *key[1:]), [])
        out.append(
            record(label, group, np.array([list(values.values())]))
            | ({} if len(values) > 1 else {"low": None, "high": None})
            | {"quantity": TOTAL if key[0] in unknown else RATIO}
            | {"cost_ratio": geometric_mean([*map(_ratio, group)]) if known else None}
            | _beside_ideal(group, plain)
        )
    return out


def record(label: str, rows: Sequence[Row], values: FloatArray) -> dict[str, Any]:
    """The record of a policy in a scenario.

    Args:
        label: Name of the policy.
        rows: Its rows.
        values: The cost ratio or the total cost of each episode, one row per training seed. Shape (s, e).

    Returns:
        Spread of the values: geometric `mean` with its interval `low` to `high`, None if it has none, `median`, `p90`,
        `worst` and `worst_seed`; means of costs, largest errors, sums of steps and misses; `first`, the first row.
    """
    first, seeds = rows[0], list(dict.fromkeys(row.seed for row in rows))
    usable = values.min() > 0.0 and np.isfinite(values).all()
    low, high = geometric_interval(values) if usable else (None, None)

    def of(column: str) -> list[Any]:
        return [value for row in rows if (value := getattr(row, column)) is not None]

    def largest(column: str, scale: float = 1.0) -> float | None:
        return max((scale * value for value in of(column)), default=None)

    times, lost = of("time_p50_us"), sum(row.lost for row in rows)
    colliding, free = first.clearance_min is not None, first.path_position_error is not None
    return {
        "policy": label,
        "scenario": first.scenario,
        "first": first,
        "reference": is_reference(first.policy),
        "steps": first.steps,
        "foresight": max(furthest(row.preview) for row in rows),
        "seeds": len(values),
        "episodes": values.shape[1],
        "rows": len(rows),
        "total_cost": geometric_mean(of("total_cost")),
        "tracking_cost": geometric_mean(of("tracking_cost")),
        "mean": geometric_mean(values),
        "low": low,
        "high": high,
        "median": statistics.median(np.ravel(values).tolist()),
        "p90": float(np.percentile(values, 90)),
        "worst": float(values.max()),
        "worst_seed": seeds[int(values.max(axis=0).argmax())],
        "lost": lost,
        "lost_percent": 100.0 * lost / len(rows),
        "followed": sum(row.followed for row in rows),
        "solver_status": max(of("solver_status"), key=lambda status: Status[status.upper()]),
        "position_error_mm": largest("position_error_max", 1e3),
        "orientation_error_mrad": largest("orientation_error_max", 1e3),
        "qdot_peak": largest("qdot_peak"),
        "qddot_peak": largest("qddot_peak"),
        **{
            f"steps_at_{kind}_limit": sum(of(f"steps_at_{kind}_limit"))
            for kind in ("joint", "velocity", "acceleration")
        },
        "time_p50_us": statistics.median(times) if times else None,
        "time_p99_us": largest("time_p99_us"),
        "deadline_misses": sum(of("deadline_misses")) if times else None,
        "free_timing": free,
        "path_time_s": largest("path_time") if len(of("path_time")) == len(rows) else None,
        "path_error_mm": largest("path_position_error", 1e3) if free else None,
        "stopped": len(of("stopped")) if colliding else None,
        "stopped_percent": 100.0 * len(of("stopped")) / len(rows) if colliding else None,
        "clearance_mm": 1e3 * min(of("clearance_min")) if colliding else None,
    }


def _beside_ideal(rows: Sequence[Row], plain: Sequence[Row]) -> dict[str, float | None]:
    """The comparison with the rows of the same policy on an ideal plant."""
    costs, there = by_seed(rows, _total), by_seed(plain, _total)
    common = [seed for seed in costs if seed in there]
    if not common or min(min(there[seed], costs[seed]) for seed in common) <= 0.0:
        return dict.fromkeys(("ideal_cost_ratio", "times_ideal", "times_ideal_low", "times_ideal_high"))
    factors = [costs[seed] / there[seed] for seed in common]
    known = [row.cost_ratio for row in plain if row.seed in costs and row.cost_ratio is not None]
    low, high = geometric_interval(factors)
    return {
        "ideal_cost_ratio": geometric_mean(known) if len(known) == len(common) else None,
        "times_ideal": geometric_mean(factors),
        "times_ideal_low": low,
        "times_ideal_high": high,
    }


def _total(row: Row) -> float:
    return row.total_cost


def _ratio(row: Row) -> float:
    return row.cost_ratio or 0.0


def by_seed(rows: Iterable[Row], value: Callable[[Row], float]) -> dict[int, float]:
    """A number of each episode: the geometric mean over its noise seeds, by its reset seed."""
    found: dict[int, list[float]] = {}
    for row in rows:
        found.setdefault(row.seed, []).append(value(row))
    return {seed: geometric_mean(values) for seed, values in found.items()}


def by_scenario(rows: Iterable[Row]) -> dict[str, list[dict[str, Any]]]:
    """The records of each scenario, in the order of the rows."""
    out: dict[str, list[dict[str, Any]]] = {}
    for one in summarise(rows):
        out.setdefault(one["scenario"], []).append(one)
    return out


def is_reference(policy: str) -> bool:
    """Whether a policy has privileged information, as far as it is known without importing code of others."""
    try:
        kind = registry.get(policy) if registry.known(policy) else registry.imported(policy)
    except IkgymError:
        return False
    return bool(getattr(kind, "reference", False))


def labels(rows: Sequence[Row]) -> list[str]:
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
