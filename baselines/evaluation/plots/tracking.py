"""Errors, clearance and position of one policy over time."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.evaluation.log import TrajectoryLog
from baselines.evaluation.plots import style
from ikgym.validation import FloatArray

# Errors below are rounding, which would flatten the other curves.
SMALLEST = 1e-10  # [m] and [rad]
ERRORS = {"position_error": "position error [m]", "orientation_error": "orientation error [rad]"}
# Where bodies touch is shown if they come so near, in [m].
TOUCHED = 0.02
HEIGHT = 1.75  # of a panel, in [in]


def draw(title: str, log: TrajectoryLog) -> Figure:
    """The plot of a log, see :func:`baselines.evaluation.log.trajectory_log`."""
    kinds = [kind for kind in ERRORS if kind in log]
    rows = len(kinds) + ("clearance" in log) + 1
    drawn = style.figure(0.7 + HEIGHT * rows)
    grid = drawn.add_gridspec(rows, 3)
    for row, kind in enumerate(kinds):
        axes = drawn.add_subplot(grid[row, :])
        lowest = max(SMALLEST, 0.5 * float(np.percentile(log[kind], 1)))
        axes.set_yscale("log")
        # Before anything is drawn: matplotlib would first look for limits, which zeros do not have.
        axes.set_ylim(lowest, max(10.0 * lowest, 1.5 * float(log[kind].max())))
        _line(axes, log["time"], np.maximum(log[kind], 0.1 * lowest))
        style.dress(axes, ylabel=ERRORS[kind])
    if "clearance" in log:
        axes = drawn.add_subplot(grid[len(kinds), :])
        _line(axes, log["time"], log["clearance"])
        if float(log["clearance"].min()) < TOUCHED:
            axes.axhline(0.0, color=style.STEEL, lw=0.8, ls=style.DASHES[2])
        style.dress(axes, ylabel="clearance [m]")
    for place, letter in enumerate("xyz"):
        axes = drawn.add_subplot(grid[-1, place])
        nominal, actual = (log[name][:, place - 3] for name in ("nominal", "pose"))  # the position comes last
        axes.plot(log["time"], nominal, color="#c4c4c4", lw=5.0, solid_capstyle="round")
        _line(axes, log["time"], actual)
        _limit(axes, nominal, actual)
        style.dress(axes, ylabel=f"{letter} [m]", xlabel="time [s]", ticks=4)
    style.legend(drawn, style.literal(title), axes.lines, ["nominal", "actual"])
    drawn.align_ylabels()
    return drawn


def _line(axes: Axes, time: FloatArray, values: FloatArray) -> None:
    axes.plot(time, values, lw=0.9, **style.looks(0))
    axes.set_xmargin(0.01)


def _limit(axes: Axes, nominal: FloatArray, actual: FloatArray) -> None:
    """Shows the nominal in full, and of a policy that has lost it at most half its range beyond."""
    low, high = float(nominal.min()), float(nominal.max())
    span = max(high - low, 1e-2)
    low = max(low - 0.5 * span, min(low, float(actual.min())))
    high = min(high + 0.5 * span, max(high, float(actual.max())))
    margin = 0.06 * max(high - low, span)
    axes.set_ylim(low - margin, high + margin)
