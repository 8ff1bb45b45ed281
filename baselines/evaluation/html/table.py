"""The table of the page, complete without scripts; DataTables sorts and filters it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from html import escape

from baselines.evaluation.html.entries import Entry
from baselines.evaluation.report import NOTHING, number

#: The value for sorting where there is none.
LAST = 1e300


@dataclasses.dataclass(frozen=True)
class Column:
    """A column of the table.

    Args:
        title: Its head.
        about: A description, shown when the pointer is on the head.
        value: The value for sorting: a number, a text, or None.
        scale: Factor of numbers.
        text: The text of a cell, if it is not the value.
    """

    title: str
    about: str
    value: Callable[[Entry], float | str | None]
    scale: float = 1.0
    text: Callable[[Entry], str] | None = None

    def cell(self, entry: Entry) -> str:
        """The cell as HTML."""
        value = self.value(entry)
        if isinstance(value, str):
            return f"<td>{escape(value)}</td>"
        known = value is not None and math.isfinite(value)
        shown = f"{value}" if isinstance(value, int) else number(value, self.scale)
        shown = self.text(entry) if self.text else shown
        return f'<td class="number" data-order="{value if known else LAST}">{escape(shown)}</td>'


def _mean(entry: Entry) -> float | None:
    return entry.summary.cost_ratio.mean if entry.summary.cost_ratio else None


def _worst(entry: Entry) -> float | None:
    return entry.summary.cost_ratio.worst if entry.summary.cost_ratio else None


def _low(entry: Entry) -> float | None:
    return entry.interval[0] if entry.interval and entry.summary.cost_ratio else None


def _interval(entry: Entry) -> str:
    ends = entry.interval if entry.summary.cost_ratio else None
    return " … ".join(map(number, ends)) if ends else NOTHING


COLUMNS = (
    Column("cost ratio", "total cost / best known cost, geometric mean over the episodes", _mean),
    Column("95 %", "interval of the mean cost ratio, over the episodes", _low, text=_interval),
    Column("worst", "largest cost ratio of an episode", _worst),
    Column("total cost", "geometric mean over the episodes", lambda one: one.summary.total_cost.mean),
    Column("pos max [mm]", "largest position error", lambda one: one.summary.position_error_max, 1e3),
    Column("ori max [mrad]", "largest orientation error", lambda one: one.summary.orientation_error_max, 1e3),
    Column("q̇ peak", "largest joint velocity, in rad/s or m/s", lambda one: one.summary.qdot_peak),
    Column("at stop", "steps in which a stop held a joint back", lambda one: one.summary.steps_at_joint_limit),
    Column("at q̇ limit", "likewise, a velocity limit", lambda one: one.summary.steps_at_velocity_limit),
    Column("at q̈ limit", "likewise, an acceleration limit", lambda one: one.summary.steps_at_acceleration_limit),
    Column("p50 [µs]", "median time of a call after the first", lambda one: one.summary.time_p50_us),
    Column("p99 [µs]", "99th percentile of these times", lambda one: one.summary.time_p99_us),
    Column("misses", "such calls longer than Δt", lambda one: one.summary.deadline_misses),
    Column("episodes", "how many were played; of a random scenario more than one", lambda one: one.summary.episodes),
    Column("lost", "episodes in which the arm lost track", lambda one: one.summary.lost),
    Column("status", "the worst of the episodes", lambda one: one.summary.status),
)


def table(all_entries: Sequence[Entry]) -> str:
    """The table as HTML; the value of a line's checkbox is the number of its entry in the data."""
    heads = [("policy", "* has privileged information"), ("scenario", "name of the scenario")]
    heads += [(column.title, column.about) for column in COLUMNS]
    out = ['<table id="results"><thead><tr><th class="pick" scope="col" aria-label="in the plots"></th>']
    out += [f'<th scope="col" title="{escape(about)}">{escape(title)}</th>' for title, about in heads]
    out.append("</tr></thead><tbody>")
    for number_of, entry in enumerate(all_entries):
        name = escape(entry.policy + " *" * entry.reference)
        out += [
            f'<tr><td class="pick"><input type="checkbox" value="{number_of}" aria-label="{name} in '
            f'{escape(entry.scenario)}: show in the plots"></td>',
            f'<th scope="row" class="name">{name}</th>',
            f"<td>{escape(entry.scenario)}</td>",
            *(column.cell(entry) for column in COLUMNS),
            "</tr>",
        ]
    return "".join([*out, "</tbody></table>"])
