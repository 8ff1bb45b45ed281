"""Cost, or cost ratio, against time per step: what a policy is worth and what it takes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from adjustText import adjust_text
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

from baselines.evaluation.plots import style
from baselines.evaluation.summary import Spread, Summary
from ikgym.validation import FloatArray

DOT = 8.0  # how wide names take a point to be, in [pt]
# How adjustText moves names, found by looking at the plots: strong forces, else names stay on crowded points. The limit
# is one of rounds: one in seconds would give other plots on other machines.
PLACING: Mapping[str, Any] = {
    "force_static": (0.3, 0.5),
    "force_text": (0.5, 0.8),
    "force_explode": (0.3, 1.0),
    "force_pull": (0.02, 0.02),
    "expand": (1.1, 1.25),
    "iter_lim": 200,
}
SMALLEST = 1e-12  # a cost of 0 has no place on a logarithmic axis
NEAREST = 1e-4  # by how much a cost ratio exceeds 1 at the lower end of its axis at most
# Keeps a label readable where a line runs behind it.
HALO = withStroke(linewidth=2.0, foreground="white", alpha=0.8)
COST_RATIO = "cost ratio"
REFERENCE = "reference: has privileged information"


@dataclasses.dataclass(frozen=True)
class Mark:
    """A policy in the picture.

    Args:
        time: Median time per step, in [µs].
        value: Its cost, or its cost ratio.
        name: What to call it; a reference ends in a star.
        colour: Of its point.
        small: Whether it is a member of a family, whose line tells what it is: its point and its name are small.
        marker: Of its point; a diamond for a reference.
    """

    time: float
    value: Spread
    name: str
    colour: str
    small: bool = False
    marker: str = "o"

    @property
    def reference(self) -> bool:
        """Whether it knows more than its observation."""
        return self.name.endswith("*")


def draw(
    title: str, summaries: Sequence[Summary], names: Mapping[int, str], looks: Mapping[int, Mapping[str, str]]
) -> Figure:
    """The picture of a scenario: the cost ratio if it is known for all, else the cost.

    Args:
        title: Stands above it.
        summaries: The results of one scenario; those without times have no place. At least one has some.
        names: What to call them, by their ids; a reference ends in a star.
        looks: Their colours, by their ids.
    """
    known = all(summary.cost_ratio is not None for summary in summaries)
    marks = [
        Mark(s.time_p50_us, (s.cost_ratio if known else None) or s.total_cost, names[id(s)], looks[id(s)]["color"])
        for s in summaries
        if s.time_p50_us is not None
    ]
    drawn = style.figure(4.2, 6.4)
    axes = drawn.subplots()
    quantity = COST_RATIO if known else "total cost"
    scatter(axes, marks, quantity=quantity, several=any(summary.episodes > 1 for summary in summaries))
    axes.set_title(title, fontsize=style.MEDIUM, loc="left")
    if any(mark.reference for mark in marks):
        axes.annotate(
            f"◇ {REFERENCE}",
            (1.0, 1.01),
            xycoords="axes fraction",
            ha="right",
            va="bottom",
            fontsize=style.SMALL - 1,
            color=style.STEEL,
        )
    label(drawn, marks)
    return drawn


def scatter(axes: Axes, marks: Sequence[Mark], *, quantity: str, several: bool, room: float = 0.25) -> None:
    """Points on logarithmic axes, with bars to the 90th percentile and to the worst where there are several episodes.

    The axis of the cost ratio is logarithmic in what it exceeds 1 by: there 1.01 and 1.1 are as far apart as 2 and 11.

    Args:
        axes: An empty panel.
        marks: The points.
        quantity: What the values are, in words.
        several: Whether there are several episodes.
        room: To be left around the points, as a share of their span.
    """
    cost_ratio = quantity == COST_RATIO
    axes.set_xscale("log")
    if cost_ratio:
        axes.set_yscale("function", functions=(_spread_out, _put_together))
    else:
        axes.set_yscale("log")
    for mark in marks:
        mean, p90, worst = (
            height(v, cost_ratio=cost_ratio) for v in (mark.value.mean, mark.value.p90, mark.value.worst)
        )
        if several:
            bar: dict[str, Any] = {"color": mark.colour, "alpha": 0.35, "solid_capstyle": "butt", "zorder": 2.0}
            axes.plot([mark.time, mark.time], [mean, max(worst, mean)], lw=0.7, **bar)
            axes.plot(mark.time, max(worst, mean), "_", ms=5, mew=0.7, **bar)
            axes.plot([mark.time, mark.time], [mean, max(p90, mean)], lw=2.2, **bar)
        # An edge of white tells points apart that overlap; references are hollow.
        hollow: dict[str, Any] = {"marker": "D", "mfc": "white", "mec": mark.colour, "mew": 1.6}
        filled: dict[str, Any] = {"marker": mark.marker, "mec": "white", "mew": 0.5}
        looks = hollow if mark.reference else filled
        axes.plot(mark.time, mean, ms=4.5 if mark.small else 8.0, color=mark.colour, zorder=3.0, ls="", **looks)
    style.dress(
        axes,
        xlabel="median time per step [µs]",
        ylabel=f"{quantity} [1]" + (", geometric mean" if several else ""),
    )
    shown = [
        height(v, cost_ratio=cost_ratio) for m in marks for v in (m.value.mean, *((m.value.worst,) if several else ()))
    ]
    axes.set_xlim(*_room([mark.time for mark in marks], room))
    over = 1.0 if cost_ratio else 0.0
    axes.set_ylim(*(over + value for value in _room([value - over for value in shown], room)))
    _ticks(axes.xaxis)
    if cost_ratio:
        _cost_ratio_ticks(axes.yaxis)
    else:
        _ticks(axes.yaxis)
    axes.grid(which="minor", color=style.MIST, lw=0.25)


def height(value: float, *, cost_ratio: bool) -> float:
    """Where a value stands; none has no place on its axis."""
    return max(value, 1.0 + NEAREST) if cost_ratio else max(value, SMALLEST)


def _spread_out(cost_ratio: FloatArray) -> FloatArray:
    out: FloatArray = np.log10(np.maximum(np.asarray(cost_ratio) - 1.0, 1e-2 * NEAREST))
    return out


def _put_together(place: FloatArray) -> FloatArray:
    out: FloatArray = 1.0 + 10.0 ** np.asarray(place)
    return out


def _cost_ratio_ticks(axis: Axis) -> None:
    """Numbers at 1.01, 1.1, 2, 10, 100, …, and between them where there is room."""
    low, high = axis.get_view_interval()
    whole = [1.0 + 10.0**k for k in range(-5, 1)] + [10.0**k for k in range(1, 13)]
    between = [1.0 + s * 10.0**k for k in range(-5, 0) for s in (2.0, 5.0)] + [
        s * 10.0**k for k in range(13) for s in (2.0, 5.0)
    ]
    if np.diff(_spread_out(np.array([low, high])))[0] < 3.5:
        whole, between = sorted({*whole, *between}), []
    axis.set_major_locator(FixedLocator([tick for tick in whole if low <= tick <= high]))
    axis.set_minor_locator(FixedLocator([tick for tick in between if low <= tick <= high]))
    axis.set_major_formatter(FuncFormatter(_cost_ratio_tick))
    axis.set_minor_formatter(NullFormatter())


def _room(values: Sequence[float], share: float) -> tuple[float, float]:
    """Limits with a share of the span around the values, and twice that share of a decade at least."""
    low, high = math.log10(min(values)), math.log10(max(values))
    margin = share * max(high - low, 2.0)
    return 10.0 ** (low - margin), 10.0 ** (high + margin)


def _ticks(axis: Axis) -> None:
    """Numbers at 1, 2, 5, … where the powers of ten alone would be too few."""
    low, high = axis.get_view_interval()
    axis.set_minor_formatter(NullFormatter())
    if math.log10(high / low) < 2.5:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(_tick))


def _tick(value: float, _: object = None) -> str:
    """A number as it stands at a tick: ``20``, or ``2 · 10⁷``."""
    if 1e-3 <= value < 1e5:
        return f"{value:g}"
    exponent = math.floor(math.log10(value) + 1e-9)
    return rf"${value / 10.0**exponent:g} \cdot 10^{{{exponent}}}$"


def _cost_ratio_tick(value: float, _: object = None) -> str:
    power = math.log10(value)
    return f"$10^{{{power:.0f}}}$" if power >= 4.0 and power.is_integer() else _tick(value)


def label(drawn: Figure, marks: Sequence[Mark], others: Sequence[Mark] = ()) -> None:
    """Writes each name beside its point, so that no two names, nor a name and a point, overlap where that can be.

    Args:
        drawn: A figure with one panel and its points.
        marks: The points that are named.
        others: Points without a name, which names avoid, too.
    """
    axes = drawn.axes[0]
    drawn.draw_without_rendering()  # settles the layout, which the places of names depend on
    drawn.set_layout_engine("none")
    cost_ratio = axes.get_yscale() != "log"
    spots = [(mark.time, height(mark.value.mean, cost_ratio=cost_ratio)) for mark in (*marks, *others)]
    # A point has no size to adjustText: five places stand for its dot.
    size = 0.5 * DOT * drawn.dpi / 72.0
    around = np.array([(0.0, 0.0), (size, size), (size, -size), (-size, size), (-size, -size)])
    dots = (axes.transData.transform(spots)[:, None] + around).reshape(-1, 2)
    x, y = axes.transData.inverted().transform(dots).T
    names = [
        axes.text(
            *spot,
            mark.name,
            fontsize=style.SMALL - (0.5 if mark.small else 0.0),
            color=mark.colour if mark.small else style.INK,
            zorder=2.9,  # below the points, which no name may hide
            path_effects=[HALO],
        )
        for mark, spot in zip(marks, spots, strict=False)
    ]
    leaders = {"arrowstyle": "-", "color": style.STEEL, "lw": 0.7, "shrinkB": 4, "zorder": 2.8}
    adjust_text(names, x=x, y=y, ax=axes, arrowprops=leaders, **PLACING)
