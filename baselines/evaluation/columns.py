"""The columns of all tables: key, head, unit and format of each, and how the values of episodes are put together."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from baselines.evaluation.metrics import FOLLOWED_ORIENTATION, FOLLOWED_POSITION
from baselines.statistics import geometric_mean
from baselines.status import Status

if TYPE_CHECKING:  # slow to import, and not needed for numbers
    import pandas as pd

#: The text of a cell without a value.
NOTHING = "–"
#: Ends of keys, and the units that they mean.
UNITS = {
    **{unit: f"[{unit}]" for unit in ("ms", "s", "mm", "mrad", "rad")},
    **{"us": "[µs]", "um": "[µm]", "deg": "[°]", "percent": "[%]"},
}
#: The errors up to which a path counts as followed, below the tables.
FOLLOWED_NOTE = (
    f"followed: at most {1e3 * FOLLOWED_POSITION:g} mm and {1e3 * FOLLOWED_ORIENTATION:g} mrad of error in all steps; "
    "solver status: the worst that the solver reported"
)


def number(value: float | None) -> str:
    """A number with four significant digits: ``1234``, ``0.01235``, ``1.235e7``; a dash for none."""
    if value is None or math.isnan(value):
        return NOTHING
    if value == 0.0:
        return "0"
    digits = f"{value:#.4g}"
    mantissa, _, exponent = digits.partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa.removesuffix(".")


def count(value: float) -> str:
    """A whole number; a dash for none."""
    return NOTHING if math.isnan(value) else f"{value:.0f}"


def interval(low: float, high: float) -> str:
    """An interval: ``1.000 … 2.000``; a dash for none."""
    return NOTHING if math.isnan(low) else f"{number(low)} … {number(high)}"


@dataclasses.dataclass(frozen=True)
class Column:
    """A column of a table. A head that is left out is made of the key, whose end may be a unit: ``time_p50_us``."""

    key: str  # the name of its values
    title: str = ""  # its head
    unit: str = ""  # the second line of the head
    about: str = ""  # a description, shown in HTML when the pointer is on the head
    _: dataclasses.KW_ONLY
    how: Any = None  # how pandas puts the values of episodes together; None if it does not
    of: str = ""  # the name of these values; that of the column if left out
    format: Callable[[Any], str] = number  # the text of a value
    drop: int = 0  # if a line is too short, columns are left out from the highest number down; those with 0 stay
    text: Callable[[Any], str] | None = None  # the text of the cell of a line, if it is not that of its value

    def __post_init__(self) -> None:
        words, _, end = self.key.rpartition("_")
        words, unit = (words, UNITS[end]) if words and end in UNITS else (self.key, "")
        title = words.replace("times_", "× ").replace("time_p", "p").replace("_", " ")
        if f"_{self.key}".endswith("_low"):  # the column of an interval, whose other end is `high`
            title = "95 %"
        object.__setattr__(self, "title", self.title or title)
        object.__setattr__(self, "unit", self.unit or unit)

    @property
    def head(self) -> str:
        """The head in one line."""
        return f"{self.title} {self.unit}".strip()

    def cells(self, lines: pd.DataFrame) -> list[str]:
        """The texts of the column."""
        if self.text is not None:
            return [self.text(line) for line in lines.itertuples()]
        return [self.format(value) for value in lines[self.key]]


def _mark(line: Any) -> str:
    """The policy with its marks, see the notes of :mod:`baselines.evaluation.report`."""
    marks = {" *": line.reference, " †": line.steps_at_joint_limit, " ‡": line.free_timing}
    return str(line.label) + "".join(mark for mark, applies in marks.items() if applies)


def _mark_unstated(line: Any) -> str:
    return number(line.qddot_peak) + " §" * (not line.stated)


def _count_followed(line: Any) -> str:
    return f"{line.followed} of {line.rows}" if line.rows > 1 else "yes" if line.followed else "no"


def geometric(values: pd.Series) -> float:
    """The geometric mean; NaN if a value is missing."""
    return geometric_mean(values) if values.notna().all() else math.nan


def _total(values: pd.Series) -> float:
    """The sum; NaN if all values are missing."""
    return float(values.sum(min_count=1))


def _largest(values: pd.Series) -> float:
    """The largest value; NaN if one is NaN, as that of an arm that diverged."""
    return float(values.max(skipna=False))


def _worst_status(statuses: pd.Series) -> str:
    return str(max(statuses, key=lambda status: Status[status.upper()]))


def _columns() -> Iterable[Column]:
    of_episodes = "geometric mean over the episodes"
    yield Column("label", "policy", format=str, text=_mark)
    yield Column("total_cost", "total", "cost", of_episodes, how=geometric)
    yield Column("tracking_cost", "tracking", "cost", how=geometric, drop=4)
    yield Column("cost_ratio", "cost", "ratio", f"total cost / best known cost, {of_episodes}", how=geometric)
    yield Column("position_error_mm", "pos max", about="largest position error", how=_largest)
    yield Column("orientation_error_mrad", "ori max", about="largest orientation error", how=_largest, drop=1)
    yield Column("qdot_peak", "q̇ peak", about="largest joint velocity, in rad/s or m/s", how=_largest, drop=2)
    about = "largest joint acceleration, in rad/s² or m/s²; § no limit stated"
    yield Column("qddot_peak", "q̈ peak", about=about, text=_mark_unstated, how=_largest, drop=3)
    for kind, short, where in (
        ("joint", "stop", "a stop"),
        ("velocity", "q̇ limit", "its velocity limit"),
        ("acceleration", "q̈ limit", "its acceleration limit"),
    ):
        about = f"steps with a joint at {where}"
        yield Column(f"steps_at_{kind}_limit", f"at {short}", about=about, how="sum", format=count)
    about = "when the end of the path was reached, with free timing"
    yield Column("path_time_s", about=about, of="path_time", how=_largest)
    about = "largest distance from the reference at the progress of the policy, with free timing"
    yield Column("path_error_mm", "path err", about=about, how=_largest)
    yield Column("clearance_mm", about="smallest distance between bodies", how="min")
    yield Column("stopped", about="episodes in which bodies would have met", how=_total, format=count)
    yield Column("time_p50_us", about="median time of a call after the first", how="median")
    yield Column("time_p99_us", about="99th percentile of these times", how="max", drop=5)
    yield Column("deadline_misses", "misses", about="such calls longer than Δt", how=_total, format=count, drop=6)
    about = "number of episodes; more than one of a random scenario"
    yield Column("episodes", about=about, of="seed", how="nunique", format=count)
    yield Column("mean", "geometric mean")
    yield from map(Column, ("median", "p90", "worst"))
    yield Column("worst_seed", format=count)
    yield Column("lost", about="episodes in which the arm was lost", how="sum", format=count)
    yield Column("followed", about=FOLLOWED_NOTE.partition(";")[0], how="sum", text=_count_followed)
    about = "the worst that the solver reported in any step"
    yield Column("solver_status", "solver", "status", about, how=_worst_status, format=str)
    yield Column("ideal_cost_ratio", "ideal", "ratio")
    yield Column("times_ideal", "× ideal", "cost")
    yield Column("times_ideal_low", text=lambda line: interval(line.times_ideal_low, line.times_ideal_high))
    about = "interval of the mean cost ratio over the episodes"
    yield Column("ratio_low", about=about, text=lambda line: interval(line.ratio_low, line.high))
    yield Column("ratio_worst", "worst", about="largest cost ratio of an episode")


#: The columns of terminal and report, and those of files that have another head than their key says, by key.
COLUMNS: Mapping[str, Column] = {one.key: one for one in _columns()}
ERRORS = ("position_error_mm", "orientation_error_mrad", "qdot_peak", "qddot_peak")
WHERE = ("path_time_s", "path_error_mm", "clearance_mm", "stopped")
TIMES = ("time_p50_us", "time_p99_us", "deadline_misses")
#: The table of all policies; of several episodes; of the comparison with ideal plants; and of the report.
POLICIES = ("label", "total_cost", "tracking_cost", "cost_ratio", *ERRORS, *WHERE, *TIMES, "followed", "solver_status")
SPREAD = ("episodes", "mean", "median", "p90", "worst", "worst_seed", "lost")
WITH_IDEAL = ("ideal_cost_ratio", "times_ideal", "times_ideal_low")
AT_LIMITS = tuple(f"steps_at_{kind}_limit" for kind in ("joint", "velocity", "acceleration"))
REPORT = (
    *("cost_ratio", "ratio_low", "ratio_worst", "total_cost", "followed", "lost", "episodes", *TIMES, *ERRORS, *WHERE),
    *(*AT_LIMITS, "solver_status"),
)
#: A ranking, and its columns where timing is free, or where there are collisions.
RANKING = (
    *("policy", "scenario", "foresight", "seeds", "episodes", "relative_to", "cost_ratio", "low", "high", "p90"),
    *("worst", "lost_percent", "time_p50_us", "time_p99_us"),
)
PATH, CONTACTS = ("path_time_s", "path_error_mm"), ("stopped_percent", "clearance_mm")
#: The Markdown table of a map over severities.
CELLS = ("policy", "knowledge", "drives", "episodes", "cost_ratio", "low", "worst", "lost_percent")


def columns(keys: Iterable[str], lines: pd.DataFrame) -> list[Column]:
    """The columns of these names that have a value in some line."""
    chosen = (COLUMNS[key] for key in keys)
    return [column for column in chosen if any(cell != NOTHING for cell in column.cells(lines))]
