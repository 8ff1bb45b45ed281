"""Joint coordinates, velocities and accelerations of one policy over time, with their limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.evaluation.plots import style

Series = Mapping[str, npt.NDArray[Any]]

#: The name of the shade in legends, and its colour.
BEYOND, SHADE = "beyond the limits", "#f3d3c8"
# Limits further off than this share of the range are not shown, as they would flatten the curves; and the edge around.
NEAR, EDGE = 0.5, 0.04
# The least range of a panel, in the unit of the quantity.
SPAN = 1e-3


class Quantity(NamedTuple):
    """A quantity of each joint.

    Attributes:
        name: Its name in titles.
        file: The beginning of the name of its files.
        column: Its array in a trajectory log.
        symbol: Its symbol.
        per: The end of its unit.
    """

    name: str
    file: str
    column: str
    symbol: str
    per: str


VELOCITIES = Quantity("Joint velocities", "velocities", "qdot", r"\dot q", "/s")
PATHS = Quantity("Joint paths", "joints", "q", "q", "")
ACCELERATIONS = Quantity("Joint accelerations", "accelerations", "qddot", r"\ddot q", "/s²")
QUANTITIES = (VELOCITIES, PATHS, ACCELERATIONS)


def draw(title: str, log: Series, quantity: Quantity) -> Figure:
    """One panel a joint: actual values, nominal ones where there are any, and limits that are near as bands.

    Args:
        title: Stands above the plot.
        log: See :func:`baselines.evaluation.export.trajectory_log`.
        quantity: The quantity.
    """
    values = log[quantity.column]
    nominal = log.get("nominal_q") if quantity is PATHS else None
    upper = log[{"qdot": "velocity_limit", "q": "upper", "qddot": "acceleration_limit"}[quantity.column]]
    lower = log["lower"] if quantity is PATHS else -upper
    lines: dict[str, Artist] = {}
    count = values.shape[1]
    columns = 2 if count > 3 else 1
    rows = -(-count // columns)
    drawn = style.figure(0.9 + 1.4 * rows)
    grid = drawn.add_gridspec(rows, columns)
    for joint in range(count):
        axes = drawn.add_subplot(grid[joint // columns, joint % columns])
        (lines["actual"],) = axes.plot(log["time"], values[:, joint], color=style.COLOURS[0], lw=1.4)
        if nominal is not None:
            dashed: dict[str, Any] = {"color": style.COLOURS[1], "lw": 1.2, "ls": (0, (4, 3))}
            (lines["nominal"],) = axes.plot(log["time"], nominal[:, joint], **dashed)
        unit = f"[{'m' if log['prismatic'][joint] else 'rad'}{quantity.per}]"
        style.dress(
            axes,
            ylabel=rf"${quantity.symbol}_{{{joint + 1}}}$ {unit}",
            xlabel="time [s]" if joint + columns >= count else "",
            title=style.literal(str(log["joint_names"][joint])),
            ticks=12 // columns,
        )
        axes.margins(x=0.01)
        _widen(axes)
        for band in _shade(axes, lower[joint], upper[joint]):
            lines[BEYOND] = band
    drawn.align_ylabels()
    style.legend(drawn, title, list(lines.values()), list(lines))
    return drawn


def _widen(axes: Axes) -> None:
    """Makes the range of a panel as large as SPAN, so that rounding errors are not enlarged."""
    low, high = axes.get_ylim()
    if high - low < SPAN:
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.5 * SPAN, middle + 0.5 * SPAN)


def _shade(axes: Axes, lower: float, upper: float) -> list[Artist]:
    """Shades the values beyond two limits, infinite where there is none, if they are near; returns the bands."""
    low, high = axes.get_ylim()
    near, edge = NEAR * (high - low), EDGE * (high - low)
    below, above = lower > low - near, upper < high + near
    bottom, top = min(low, lower - edge) if below else low, max(high, upper + edge) if above else high
    bands = [axes.axhspan(bottom, lower, color=SHADE, lw=0, zorder=0)] if below else []
    bands += [axes.axhspan(upper, top, color=SHADE, lw=0, zorder=0)] if above else []
    axes.set_ylim(bottom, top)
    return list(bands)
