"""The plots of the leaderboard: the geometric means with their intervals, and performance profiles."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from baselines.evaluation.pages.measurement import AGENT, FAR, NEAR, REFERENCE, RESIDUAL
from baselines.evaluation.pages.statistics import profile
from baselines.evaluation.plots import style
from baselines.evaluation.report import number
from ikgym.validation import FloatArray

#: Colours of the kinds.
COLOURS: Mapping[str, str] = {
    AGENT: style.COLOURS[0],
    RESIDUAL: style.COLOURS[3],
    FAR: style.COLOURS[2],
    NEAR: style.STEEL,
    REFERENCE: style.INK,
}
#: The largest cost ratio that has a place of its own in the plots.
CUT = 1e3
POINTS = 600  # of a curve


@dataclasses.dataclass(frozen=True)
class Mean:
    """A line of the leaderboard in the plot of means.

    Args:
        name: What to call it.
        kind: Of whom it is one.
        mean: Geometric mean of the cost ratio.
        low: Lower end of its interval.
        high: Upper end.
    """

    name: str
    kind: str
    mean: float
    low: float
    high: float


def means(title: str, marks: Sequence[Mean]) -> Figure:
    """Means with their intervals, one below the other; those beyond the cut stand at the edge, with an arrow.

    Args:
        title: Stands above it.
        marks: From low to high.
    """
    drawn = style.figure(1.0 + 0.165 * len(marks))
    axes = drawn.subplots()
    axes.set_xscale("log")
    for place, mark in enumerate(marks):
        colour = COLOURS[mark.kind]
        low, high = max(mark.low, 1e-9), min(mark.high, CUT)
        if mark.mean > CUT:
            axes.plot(CUT, place, ">", ms=5, color=colour, clip_on=False, zorder=3)
        else:
            axes.plot([low, high], [place, place], color=colour, lw=2.4, alpha=0.45, solid_capstyle="butt")
            if mark.high > CUT:
                axes.plot(CUT, place, ">", ms=3.5, color=colour, alpha=0.6, clip_on=False)
            axes.plot(mark.mean, place, "D" if mark.kind == REFERENCE else "o", ms=4.5, color=colour, zorder=3)
        axes.annotate(
            number(mark.mean),
            (1.0, place),
            xycoords=("axes fraction", "data"),
            xytext=(52, 0),
            textcoords="offset points",
            ha="right",
            va="center",
            fontsize=style.SMALL - 1,
            color=style.INK,
        )
    style.dress(axes, xlabel="cost ratio [1], geometric mean and its interval of 95 %", ylabel="")
    axes.set_yticks(range(len(marks)), [mark.name for mark in marks])
    for text, mark in zip(axes.get_yticklabels(), marks, strict=True):
        text.set_color(style.INK if mark.kind == NEAR else COLOURS[mark.kind])
        text.set_fontsize(style.SMALL - 1)
    axes.set_ylim(len(marks) - 0.3, -0.7)
    axes.set_xlim(min([0.93, *(0.95 * mark.low for mark in marks)]), CUT)
    _ratios(axes)
    there = [kind for kind in COLOURS if any(mark.kind == kind for mark in marks)]
    handles: list[Artist] = [Line2D([], [], color=COLOURS[kind], marker="o", ms=5, lw=2.4) for kind in there]
    style.legend(drawn, title, handles, there)
    return drawn


def profiles(title: str, cost_ratios: Mapping[str, FloatArray], kinds: Mapping[str, str]) -> Figure:
    """Performance profiles: which share of runs has at most which cost ratio.

    Args:
        title: Stands above it.
        cost_ratios: Of each line, by its name, from the best on.
        kinds: Of each line: agents are drawn thick and solid.
    """
    drawn = style.figure(5.2)
    axes = drawn.subplots()
    axes.set_xscale("log")
    ratios = np.geomspace(1.0, CUT, POINTS)
    handles: list[Artist] = []
    # Agents have the solid lines, solvers the others.
    place = {True: 0, False: len(style.COLOURS)}
    for name, values in cost_ratios.items():
        learned = kinds[name] in (AGENT, RESIDUAL)
        handles += axes.plot(
            ratios,
            100.0 * profile(values, ratios),
            lw=2.2 if learned else 1.2,
            zorder=3 + learned,
            **style.looks(place[learned]),
        )
        place[learned] += 1
    style.dress(axes, xlabel="cost ratio τ [1]", ylabel="runs of at most that cost ratio [%]")
    axes.set_xlim(1.0, CUT)
    axes.set_ylim(0.0, 101.0)
    _ratios(axes)
    style.legend(drawn, title, handles, list(cost_ratios))
    return drawn


def _ratios(axes: Axes) -> None:
    """Numbers at 1, 2, 5, 10, … instead of powers."""
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
