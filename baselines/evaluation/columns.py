"""The columns of all tables, how they follow from episodes, and which of them each table has."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from baselines.evaluation.metrics import FOLLOWED_ORIENTATION, FOLLOWED_POSITION
from baselines.evaluation.table import NOTHING, Column, count, interval, number
from baselines.statistics import geometric_mean
from baselines.status import Status

FOLLOWED_NOTE = (
    f"followed: at most {1e3 * FOLLOWED_POSITION:g} mm and {1e3 * FOLLOWED_ORIENTATION:g} mrad of error in all steps; "
    "solver status: the worst that the solver reported"
)


def _marked(line: Any) -> str:
    """The policy with its marks, see the notes of :mod:`baselines.evaluation.report`."""
    marks = {" *": line.reference, " †": line.steps_at_joint_limit, " ‡": line.free_timing}
    return str(line.label) + "".join(mark for mark, applies in marks.items() if applies)


def _followed(line: Any) -> str:
    return f"{line.followed} of {line.rows}" if line.rows > 1 else "yes" if line.followed else "no"


def geometric(values: pd.Series) -> float:
    """The geometric mean; NaN if a value is missing."""
    return geometric_mean(values) if values.notna().all() else math.nan


def total(values: pd.Series) -> float:
    """The sum; NaN if all values are missing."""
    return float(values.sum(min_count=1))


def largest(values: pd.Series) -> float:
    """The largest value; NaN if one is NaN, as that of an arm that diverged."""
    return float(values.max(skipna=False))


def in_thousandths(values: pd.Series) -> float:
    """The largest value in thousandths of its unit."""
    return 1e3 * largest(values)


def worst_status(statuses: pd.Series) -> str:
    """The worst status of a solver."""
    return str(max(statuses, key=lambda status: Status[status.upper()]))


#: All columns of terminal and report, by name.
COLUMNS: Mapping[str, Column] = {
    one.key: one
    for one in (
        Column("label", "policy", format=str, text=_marked),
        Column("total_cost", "total", "cost", "geometric mean over the episodes", how=geometric),
        Column("tracking_cost", "tracking", "cost", how=geometric, drop=4),
        Column(
            *("cost_ratio", "cost", "ratio", "total cost / best known cost, geometric mean over the episodes"),
            how=geometric,
        ),
        Column(
            *("position_error_mm", "pos max", "[mm]", "largest position error"),
            of="position_error_max",
            how=in_thousandths,
        ),
        Column(
            *("orientation_error_mrad", "ori max", "[mrad]", "largest orientation error"),
            of="orientation_error_max",
            how=in_thousandths,
            drop=1,
        ),
        Column("qdot_peak", "q̇ peak", "", "largest joint velocity, in rad/s or m/s", how=largest, drop=2),
        Column(
            *("qddot_peak", "q̈ peak", "", "largest joint acceleration, in rad/s² or m/s²; § no limit stated"),
            how=largest,
            drop=3,
            text=lambda line: number(line.qddot_peak) + " §" * (not line.stated),
        ),
        Column("steps_at_joint_limit", "at stop", "", "steps with a joint at a stop", how="sum", format=count),
        Column(
            *("steps_at_velocity_limit", "at q̇ limit", "", "steps with a joint at its velocity limit"),
            how="sum",
            format=count,
        ),
        Column(
            *("steps_at_acceleration_limit", "at q̈ limit", "", "steps with a joint at its acceleration limit"),
            how="sum",
            format=count,
        ),
        Column(
            *("path_time_s", "path time", "[s]", "when the end of the path was reached, with free timing"),
            of="path_time",
            how=largest,
        ),
        Column(
            *("path_error_mm", "path err", "[mm]"),
            "largest distance from the reference at the policy's own progress, with free timing",
            of="path_position_error",
            how=in_thousandths,
        ),
        Column(
            *("clearance_mm", "clearance", "[mm]", "smallest distance between bodies"),
            of="clearance_min",
            how=lambda values: 1e3 * values.min(),
        ),
        Column("stopped", "stopped", "", "episodes in which bodies would have met", how=total, format=count),
        Column("time_p50_us", "p50", "[µs]", "median time of a call after the first", how="median"),
        Column("time_p99_us", "p99", "[µs]", "99th percentile of these times", how="max", drop=5),
        Column("deadline_misses", "misses", "", "such calls longer than Δt", how=total, format=count, drop=6),
        Column(
            *("episodes", "episodes", "", "number of episodes; more than one of a random scenario"),
            of="seed",
            how="nunique",
            format=count,
        ),
        Column("mean", "geometric mean"),
        Column("median", "median"),
        Column("p90", "p90"),
        Column("worst", "worst"),
        Column("worst_seed", "worst seed", format=count),
        Column("lost", "lost", "", "episodes in which the arm was lost", how="sum", format=count),
        Column("followed", "followed", "", FOLLOWED_NOTE.partition(";")[0], how="sum", text=_followed),
        Column(
            *("solver_status", "solver", "status", "the worst that the solver reported in any step"),
            how=worst_status,
            format=str,
        ),
        Column("ideal_cost_ratio", "ideal", "ratio"),
        Column("times_ideal", "× ideal", "cost"),
        Column("times_ideal_low", "95 %", text=lambda line: interval(line.times_ideal_low, line.times_ideal_high)),
        Column(
            *("ratio_low", "95 %", "", "interval of the mean cost ratio over the episodes"),
            text=lambda line: interval(line.ratio_low, line.high),
        ),
        Column("ratio_worst", "worst", "", "largest cost ratio of an episode"),
    )
}


def columns(keys: Iterable[str], lines: pd.DataFrame) -> list[Column]:
    """The columns of these names that have a value in some line."""
    found = (COLUMNS[key] for key in keys)
    return [column for column in found if any(cell != NOTHING for cell in column.cells(lines))]


ERRORS = ("position_error_mm", "orientation_error_mrad", "qdot_peak", "qddot_peak")
WHERE = ("path_time_s", "path_error_mm", "clearance_mm", "stopped")
TIMES = ("time_p50_us", "time_p99_us", "deadline_misses")
#: The table of all policies; of several episodes; of the comparison with ideal plants; and of the report.
POLICIES = ("label", "total_cost", "tracking_cost", "cost_ratio", *ERRORS, *WHERE, *TIMES, "followed", "solver_status")
SPREAD = ("episodes", "mean", "median", "p90", "worst", "worst_seed", "lost")
BESIDE_IDEAL = ("ideal_cost_ratio", "times_ideal", "times_ideal_low")
AT_LIMITS = tuple(f"steps_at_{kind}_limit" for kind in ("joint", "velocity", "acceleration"))
REPORT = (
    *("cost_ratio", "ratio_low", "ratio_worst", "total_cost", "followed", "lost", "episodes", *TIMES, *ERRORS, *WHERE),
    *(*AT_LIMITS, "solver_status"),
)
