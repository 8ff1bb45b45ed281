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
    """A line of k points, or the points alone; those of the same name in a figure share colour and legend entry."""

    name: str
    x: FloatArray
    y: FloatArray
    dashed: bool = False
    dots: bool = False


class Panel(NamedTuple):
    """Curves over one pair of axes; labels have units, and that of the abscissa is always in the lowest row."""

    ylabel: str
    curves: Sequence[Curve]
    xlabel: str = "time [s]"
    log: bool = False
    title: str = ""


def compare_coordinates(
    labels: Sequence[str],
    x: FloatArray,
    actual: FloatArray,
    nominal: FloatArray,
    names: tuple[str, str] = ("actual", "nominal"),
    xlabel: str = "time [s]",
) -> list[Panel]:
    """A panel for each of m coordinates, actual and nominal ones of shape (k, m) over abscissae of shape (k,)."""
    return [
        Panel(label, [Curve(names[0], x, actual[:, i]), Curve(names[1], x, nominal[:, i], dashed=True)], xlabel)
        for i, label in enumerate(labels)
    ]


def picture(title: str, panels: Sequence[Panel], *, columns: int = 1, height: float = 2.1) -> Figure:
    """Panels in rows of a number of columns and a height in [in], with one legend for all."""
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
