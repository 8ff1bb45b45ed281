"""The columns of all tables, and which of them each table has."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from baselines.evaluation.metrics import FOLLOWED_ORIENTATION, FOLLOWED_POSITION
from baselines.evaluation.table import NOTHING, Column, count, interval, number

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


#: All columns of terminal and report, by name.
COLUMNS: Mapping[str, Column] = {
    one.key: one
    for one in (
        Column("label", "policy", format=str, text=_marked),
        Column("cost_ratio", "cost", "ratio", "total cost / best known cost, geometric mean over the episodes"),
        Column("total_cost", "total", "cost", "geometric mean over the episodes"),
        Column("tracking_cost", "tracking", "cost", drop=4),
        Column("position_error_mm", "pos max", "[mm]", "largest position error"),
        Column("orientation_error_mrad", "ori max", "[mrad]", "largest orientation error", drop=1),
        Column("qdot_peak", "q̇ peak", about="largest joint velocity, in rad/s or m/s", drop=2),
        Column(
            "qddot_peak",
            "q̈ peak",
            about="largest joint acceleration, in rad/s² or m/s²; § no limit stated",
            drop=3,
            text=lambda line: number(line.qddot_peak) + " §" * (not line.stated),
        ),
        Column("steps_at_joint_limit", "at stop", about="steps with a joint at a stop", format=count),
        Column("steps_at_velocity_limit", "at q̇ limit", about="steps with a joint at its velocity limit", format=count),
        Column(
            "steps_at_acceleration_limit",
            "at q̈ limit",
            about="steps with a joint at its acceleration limit",
            format=count,
        ),
        Column("path_time_s", "path time", "[s]", "when the end of the path was reached, with free timing"),
        Column(
            *("path_error_mm", "path err", "[mm]"),
            "largest distance from the reference at the policy's own progress, with free timing",
        ),
        Column("clearance_mm", "clearance", "[mm]", "smallest distance between bodies"),
        Column("stopped", "stopped", about="episodes in which bodies would have met", format=count),
        Column("time_p50_us", "p50", "[µs]", "median time of a call after the first"),
        Column("time_p99_us", "p99", "[µs]", "99th percentile of these times", drop=5),
        Column("deadline_misses", "misses", about="such calls longer than Δt", format=count, drop=6),
        Column(*("episodes", "episodes"), about="number of episodes; more than one of a random scenario", format=count),
        Column("mean", "geometric mean"),
        Column("median", "median"),
        Column("p90", "p90"),
        Column("worst", "worst"),
        Column("worst_seed", "worst seed", format=count),
        Column("lost", "lost", about="episodes in which the arm was lost", format=count),
        Column(*("followed", "followed"), about=FOLLOWED_NOTE.partition(";")[0], text=_followed),
        Column("solver_status", "solver", "status", "the worst that the solver reported in any step", format=str),
        Column("ideal_cost_ratio", "ideal", "ratio"),
        Column("times_ideal", "× ideal", "cost"),
        Column("times_ideal_low", "95 %", text=lambda line: interval(line.times_ideal_low, line.times_ideal_high)),
        Column(
            *("ratio_low", "95 %"),
            about="interval of the mean cost ratio over the episodes",
            text=lambda line: interval(line.ratio_low, line.high),
        ),
        Column("ratio_worst", "worst", about="largest cost ratio of an episode"),
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
    *("cost_ratio", "ratio_low", "ratio_worst", "total_cost", *ERRORS, *AT_LIMITS, *WHERE, *TIMES, "episodes", "lost"),
    *("followed", "solver_status"),
)
