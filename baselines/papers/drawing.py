"""Figures of the papers: panels in rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from baselines.evaluation.plots import style
from ikgym.validation import FloatArray


class Curve(NamedTuple):
    """A line.

    Attributes:
        name: Its legend entry; curves of the same name in a figure share colour and entry.
        x: Abscissae. Shape (k,).
        y: Ordinates. Shape (k,).
        dashed: Whether the line is dashed, as nominal curves are.
        dots: Whether there are single points instead of a line.
    """

    name: str
    x: FloatArray
    y: FloatArray
    dashed: bool = False
    dots: bool = False


class Panel(NamedTuple):
    """Curves over one pair of axes.

    Attributes:
        ylabel: Label of the ordinate, with the unit.
        curves: The curves.
        xlabel: Label of the abscissa, with the unit; always shown in the lowest row.
        log: Whether the ordinate is logarithmic.
        title: The title of the panel.
    """

    ylabel: str
    curves: Sequence[Curve]
    xlabel: str = "time [s]"
    log: bool = False
    title: str = ""


def compared(
    labels: Sequence[str],
    x: FloatArray,
    actual: FloatArray,
    nominal: FloatArray,
    names: tuple[str, str] = ("actual", "nominal"),
    xlabel: str = "time [s]",
) -> list[Panel]:
    """A panel for each coordinate, with its actual and its nominal course.

    Args:
        labels: Labels of the ordinates, with the units.
        x: Abscissae. Shape (k,).
        actual: Actual coordinates. Shape (k, m).
        nominal: Nominal ones. Shape (k, m).
        names: Names of both in the legend.
        xlabel: Label of the abscissa.
    """
    return [
        Panel(label, [Curve(names[0], x, actual[:, i]), Curve(names[1], x, nominal[:, i], dashed=True)], xlabel)
        for i, label in enumerate(labels)
    ]


def picture(title: str, panels: Sequence[Panel], *, columns: int = 1, height: float = 2.1) -> Figure:
    """Panels in rows, with one legend for all.

    Args:
        title: The title of the figure.
        panels: From left to right, from top to bottom.
        columns: Panels in a row.
        height: Height of a row in [in].
    """
    rows = -(-len(panels) // columns)
    drawn = style.figure(0.8 + height * rows)
    grid = drawn.add_gridspec(rows, columns)
    names: dict[str, int] = {}
    handles: dict[str, Artist] = {}
    for place, panel in enumerate(panels):
        axes = drawn.add_subplot(grid[place // columns, place % columns])
        if panel.log:
            axes.set_yscale("log")
            axes.tick_params(axis="y", which="minor", labelsize=style.SMALL)
        for curve in panel.curves:
            colour = style.looks(names.setdefault(curve.name, len(names)))["color"]
            line = "" if curve.dots else (0, (4, 2)) if curve.dashed else "-"
            (handle,) = axes.plot(
                curve.x,
                _drawable(curve.y, log=panel.log),
                color=colour,
                linestyle=line,
                marker="." if curve.dots else "",
                markersize=3.0,
                lw=1.6 if curve.dashed else 1.2,
            )
            handles.setdefault(curve.name, handle)
        last = place >= len(panels) - columns
        style.dress(
            axes,
            ylabel=panel.ylabel,
            xlabel=panel.xlabel if last or panel.xlabel != "time [s]" else "",
            title=panel.title,
            ticks=8 if columns == 1 else 5,
        )
        axes.margins(x=0.01)
    style.legend(drawn, title, list(handles.values()), list(handles))
    drawn.align_ylabels()
    return drawn


def _drawable(values: FloatArray, *, log: bool) -> FloatArray:
    """Values with NaN for those that a logarithmic axis cannot show."""
    return np.where(values > 0.0, values, np.nan) if log else values
