"""Task coordinates over time, nominal and actual, and the errors: all policies of a scenario in one picture."""

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
COLUMNS = 3


def draw(title: str, logs: Sequence[tuple[str, Series]]) -> Figure:
    """The plot.

    Args:
        title: Stands above it.
        logs: Names of policies, those of references with a star at the end, and the logs of their episodes;
            at most :data:`MOST`. A later one is drawn wider and below those before, so that all are visible where
            they agree.
    """
    first = logs[0][1]
    coordinates = first["nominal"].shape[1]
    oriented = "orientation_error" in first
    rows, errors = -(-coordinates // COLUMNS), 1 + oriented
    drawn = style.figure(0.7 + 1.45 * rows + 1.75 * errors)
    grid = drawn.add_gridspec(rows + errors, COLUMNS, height_ratios=[1.45] * rows + [1.75] * errors)

    lines: list[Any] = []
    for place, (column, label) in enumerate(zip(order(coordinates), coordinate_labels(coordinates), strict=True)):
        axes = drawn.add_subplot(grid[place // COLUMNS, place % COLUMNS])
        nominal = first["nominal"][:, column]
        lines = axes.plot(first["time"], nominal, color="#c4c4c4", lw=5.0, solid_capstyle="round")
        for number, (_, log) in reversed(list(enumerate(logs))):
            lines += axes.plot(log["time"], log["pose"][:, column], lw=_width(number, len(logs)), **style.looks(number))
        _limit(axes, nominal, [log["pose"][:, column] for _, log in logs])
        style.dress(axes, ylabel=label, xlabel="time [s]" if place >= coordinates - COLUMNS else "", ticks=4)
        axes.margins(x=0.02)
    style.legend(drawn, title, [lines[0], *lines[:0:-1]], ["nominal", *(name for name, _ in logs)])

    kinds = [("position_error", "position error [m]"), ("orientation_error", "orientation error [rad]")][:errors]
    for place, (kind, label) in enumerate(kinds):
        axes = drawn.add_subplot(grid[rows + place, :])
        _draw_errors(axes, [(name, log[kind]) for name, log in logs], first["time"])
        style.dress(axes, ylabel=label, xlabel="time [s]" if place + 1 == errors else "")
    drawn.align_ylabels()
    return drawn


def order(coordinates: int) -> list[int]:
    """The columns of task coordinates in the order of their panels: the position, which comes last, first."""
    return [*range(coordinates - 3, coordinates), *range(coordinates - 3)]


def coordinate_labels(coordinates: int) -> list[str]:
    """Names and units of task coordinates in the order of their panels, see :mod:`ikgym.tasks`."""
    indices = {3: [], 6: ["12", "13", "23"], 12: [f"{i}{j}" for i in "123" for j in "123"]}.get(
        coordinates, [str(i) for i in range(coordinates - 3)]
    )
    letter = "O^A" if coordinates == 6 else "R"
    return ["x [m]", "y [m]", "z [m]", *(rf"${letter}_{{{index}}}$ [1]" for index in indices)]


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
