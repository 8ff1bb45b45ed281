"""The lines of the page: policies in scenarios."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from baselines.canonical import canonical
from baselines.evaluation.metrics import Row
from baselines.evaluation.report import by_scenario, is_reference, labels
from baselines.evaluation.summary import Summary, by_seed, geometric_interval


@dataclasses.dataclass(frozen=True)
class Entry:
    """A policy in a scenario: a line of the table, a point of cost and time, a replay.

    Args:
        scenario: The name of the scenario.
        policy: The label of the policy.
        reference: Whether it has privileged information.
        summary: The summary of its rows.
        rows: Its rows; the first one has a trajectory log.
    """

    scenario: str
    policy: str
    reference: bool
    summary: Summary
    rows: Sequence[Row]
    interval: tuple[float, float] | None = dataclasses.field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "interval", self._interval())

    @property
    def quantity(self) -> str:
        """The score: cost ratio where it is known."""
        return "total cost" if self.summary.cost_ratio is None else "cost ratio"

    def _interval(self) -> tuple[float, float] | None:
        """Of 95 %, of the geometric mean; none of a single episode, nor where a cost has no logarithm."""
        known = self.quantity == "cost ratio"
        values = list(by_seed(self.rows, lambda row: (row.cost_ratio if known else row.total_cost) or 0.0).values())
        usable = len(values) > 1 and all(0.0 < value < math.inf for value in values)
        return geometric_interval(values) if usable else None


def entries(rows: Sequence[Row]) -> list[Entry]:
    """One for each policy with its parameters in each scenario; those of a scenario stand together.

    Raises:
        InvalidInputError: The rows cannot be compared.
    """
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.scenario, row.policy, canonical(row.parameters)), []).append(row)
    out = []
    for scenario, summaries in by_scenario(rows).items():
        names = labels(summaries)
        for one in summaries:
            own = groups[scenario, one.policy, canonical(one.parameters)]
            out.append(Entry(scenario, names[id(one)], is_reference(one.policy), one, own))
    return out
