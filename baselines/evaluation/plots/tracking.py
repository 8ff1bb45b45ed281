"""Errors, clearance and position over time: all policies of a scenario in one picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.evaluation.plots import style
from ikgym.validation import FloatArray

Series = Mapping[str, npt.NDArray[Any]]

#: Most policies that can be distinguished in one plot.
MOST = len(style.COLOURS)
# Errors below are rounding, which would flatten the other curves.
SMALLEST = 1e-10  # [m] and [rad]
ERRORS = {"position_error": "position error [m]", "orientation_error": "orientation error [rad]"}
# Where bodies touch is shown if they come so near, in [m].
TOUCHED = 0.02
HEIGHT = 1.75  # of a panel, in [in]


def draw(title: str, logs: Sequence[tuple[str, Series]]) -> Figure:
    """The plot.

    Args:
        title: Stands above it.
        logs: Names of policies, those of references with a star at the end, and the logs of their episodes;
            at most :data:`MOST`. A later one is drawn wider and below those before, so that all are visible where
            they agree.
    """
    first = logs[0][1]
    kinds = [kind for kind in ERRORS if kind in first]
    rows = len(kinds) + ("clearance" in first) + 1
    drawn = style.figure(0.7 + HEIGHT * rows)
    grid = drawn.add_gridspec(rows, 3)
    for row, kind in enumerate(kinds):
        axes = drawn.add_subplot(grid[row, :])
        _draw_errors(axes, [(name, log[kind]) for name, log in logs], first["time"])
        style.dress(axes, ylabel=ERRORS[kind])
    if "clearance" in first:
        _draw_clearance(drawn.add_subplot(grid[len(kinds), :]), logs)
    lines: list[Any] = []
    for place, letter in enumerate("xyz"):
        lines = _draw_position(drawn.add_subplot(grid[-1, place]), f"{letter} [m]", place - 3, logs)
    style.legend(drawn, title, [lines[0], *lines[:0:-1]], ["nominal", *(name for name, _ in logs)])
    drawn.align_ylabels()
    return drawn


def _draw_position(axes: Axes, label: str, column: int, logs: Sequence[tuple[str, Series]]) -> list[Any]:
    """One component of the position, the last three of the task coordinates; returns the lines, the nominal first."""
    first = logs[0][1]
    nominal = first["nominal"][:, column]
    lines: list[Any] = axes.plot(first["time"], nominal, color="#c4c4c4", lw=5.0, solid_capstyle="round")
    for number, (_, log) in reversed(list(enumerate(logs))):
        lines += axes.plot(log["time"], log["pose"][:, column], lw=_width(number, len(logs)), **style.looks(number))
    _limit(axes, nominal, [log["pose"][:, column] for _, log in logs])
    style.dress(axes, ylabel=label, xlabel="time [s]", ticks=4)
    axes.margins(x=0.02)
    return lines


def _draw_errors(axes: Axes, errors: Sequence[tuple[str, FloatArray]], time: FloatArray) -> None:
    """Errors of all policies; those of references, which are rounding errors, may be below the axis."""
    contenders = [error for name, error in errors if not name.endswith("*")] or [error for _, error in errors]
    lowest = max(SMALLEST, 0.5 * min(float(np.percentile(error, 1)) for error in contenders))
    axes.set_yscale("log")
    # Before anything is drawn: matplotlib would first look for limits of its own, which zeros do not have.
    axes.set_ylim(lowest, max(10.0 * lowest, *(1.5 * float(error.max()) for _, error in errors)))
    for number, (_, error) in reversed(list(enumerate(errors))):
        axes.plot(time, np.maximum(error, 0.1 * lowest), lw=_width(number, len(errors)), **style.looks(number))
    axes.set_xmargin(0.01)
    if below := [name for name, error in errors if np.median(error) < lowest]:
        axes.set_title(f"below the axis: {', '.join(below)}", loc="right", fontsize=style.SMALL, color=style.STEEL)


def _draw_clearance(axes: Axes, logs: Sequence[tuple[str, Series]]) -> None:
    """The clearance of all policies, and where bodies touch."""
    for number, (_, log) in reversed(list(enumerate(logs))):
        axes.plot(log["time"], log["clearance"], lw=_width(number, len(logs)), **style.looks(number))
    if min(float(log["clearance"].min()) for _, log in logs) < TOUCHED:
        axes.axhline(0.0, color=style.STEEL, lw=0.8, ls=style.DASHES[2])
    style.dress(axes, ylabel="clearance [m]")
    axes.set_xmargin(0.01)


def _width(number: int, of: int) -> float:
    """The width of the number-th of many lines, in [pt]: wider from top to bottom."""
    return 0.9 + 1.7 * number / max(of - 1, 1)


def _limit(axes: Axes, nominal: FloatArray, actual: Sequence[FloatArray]) -> None:
    """Shows the nominal in full, and of policies that have lost it at most half its range beyond."""
    low, high = float(nominal.min()), float(nominal.max())
    span = max(high - low, 1e-2)
    low = max(low - 0.5 * span, min(low, *(float(values.min()) for values in actual)))
    high = min(high + 0.5 * span, max(high, *(float(values.max()) for values in actual)))
    margin = 0.06 * max(high - low, span)
    axes.set_ylim(low - margin, high + margin)
