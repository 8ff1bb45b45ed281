"""Plots of a table of results: cost against time, and cost over two severities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import FuncFormatter, Locator, LogLocator, MaxNLocator, NullFormatter, NullLocator

from baselines.evaluation.columns import number
from baselines.evaluation.plots import style

#: Excess costs below this are drawn here, in [%].
FLOOR = 0.01
#: Cost ratios above this have the colour of this one.
CUT = 100.0
#: Values within the first factor have several ticks a decade, within the second evenly spaced ones.
CLOSE, EVEN = 300.0, 4.0
#: Lines of a table: a frame, or the value of each column, or its text, by name.
Lines: TypeAlias = pd.DataFrame | Sequence[Mapping[str, Any]]
#: Columns of numbers.
NUMBERS = ("cost_ratio", "low", "high", "time_p99_us", "foresight", "episodes", "lost_percent", "knowledge", "drives")
EXCESS = "cost above the reference [%]"


def front(lines: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The lines of the Pareto front, see :func:`cost_time`, fast to slow."""
    return [lines[place] for place in _front(_frame(lines)).index]


def cost_time(lines: Lines, title: str) -> Figure:
    """Excess cost against the 99th percentile of the time per call, with intervals and the Pareto front.

    All policies have a name in the legend if there are colours enough; else those of the front.
    """
    drawn, table = style.figure(4.6), _frame(lines)
    axes, timed, best = drawn.subplots(), table[_is_timed(table)], _front(table)
    named = timed if len(timed) <= len(style.COLOURS) else best
    for line in timed.drop(named.index).itertuples():
        _interval(axes, line.time_p99_us, line, color=style.STEEL, marker="o", ms=3.5, lw=0.8)
    axes.step(best.time_p99_us, best.excess, where="post", color=style.MIST, lw=3.0, zorder=1)
    points = []
    for place, line in enumerate(named.itertuples()):
        look = {"color": style.looks(place)["color"], "marker": "osD^v"[place % 5]}
        points.append(_interval(axes, line.time_p99_us, line, ms=7.0, lw=1.2, ls="", **look))
    _set_logarithmic(axes)
    style.dress(axes, xlabel="time of a call, 99th percentile [µs]", ylabel=EXCESS)
    title = style.literal(f"{title}: cost against time, and the Pareto front")
    style.legend(drawn, title, points, [style.literal(str(policy)) for policy in named.policy])
    return drawn


def severity_map(lines: Lines) -> Figure:
    """Cost ratios over two severities of the plant, one panel per policy; below them the share of lost episodes."""
    panels_of = list(_frame(lines).groupby("policy", sort=False))
    across = min(len(panels_of), 2)
    down = -(-len(panels_of) // across)
    drawn = style.figure(3.4 * down + 0.4, 3.8 * across + 0.8)
    panels = drawn.subplots(down, across, squeeze=False).ravel()
    shades = [_severities(axes, str(policy), some) for axes, (policy, some) in zip(panels, panels_of, strict=False)]
    for axes in panels[len(panels_of) :]:
        axes.set_visible(False)
    bar = drawn.colorbar(shades[0], ax=panels.tolist(), shrink=0.7, extend="max")
    bar.set_label("cost ratio", fontsize=style.SMALL)
    bar.ax.tick_params(labelsize=style.SMALL)
    return drawn


def _severities(axes: Axes, policy: str, table: pd.DataFrame) -> AxesImage:
    ratios = table.pivot(index="drives", columns="knowledge", values="cost_ratio")
    for line in table.itertuples():
        text = number(line.cost_ratio) + (f"\n{line.lost_percent:.0f} % lost" if line.lost_percent else "")
        colour = "white" if line.cost_ratio > np.sqrt(CUT) else style.INK
        place = ratios.columns.get_loc(line.knowledge), ratios.index.get_loc(line.drives)
        axes.text(*place, text, ha="center", va="center", fontsize=style.SMALL, color=colour)
    shade = axes.imshow(np.clip(ratios, 1.0, CUT), norm=LogNorm(1.0, CUT), cmap="viridis_r", origin="lower")
    axes.set_title(style.literal(policy), fontsize=style.MEDIUM, loc="left")
    axes.set_xticks(range(len(ratios.columns)), [f"{one:g}" for one in ratios.columns], fontsize=style.SMALL)
    axes.set_yticks(range(len(ratios)), [f"{one:g}" for one in ratios.index], fontsize=style.SMALL)
    axes.set_xlabel("severity of calibration, payload and camera", fontsize=style.SMALL)
    axes.set_ylabel("severity of lag and delay", fontsize=style.SMALL)
    return shade


def _frame(lines: Lines) -> pd.DataFrame:
    """The lines with numbers, NaN for none, and costs above the reference in [%] with the ends of their interval."""
    table = pd.DataFrame(lines)
    table = table.assign(**{name: pd.to_numeric(table[name], errors="coerce") for name in NUMBERS if name in table})
    ends = {"excess": table.cost_ratio, "excess_low": table.low, "excess_high": table.high}
    return table.assign(**{k: (100.0 * (v.fillna(table.cost_ratio) - 1.0)).clip(lower=FLOOR) for k, v in ends.items()})


def _is_timed(table: pd.DataFrame) -> pd.Series:
    return np.isfinite(table.time_p99_us) & np.isfinite(table.cost_ratio)


def _front(table: pd.DataFrame) -> pd.DataFrame:
    """The Pareto front, fast to slow: lines that no other beats in both 99th percentile of the time and cost ratio.

    Lines without times, or with fewer episodes than others, are left out.
    """
    timed = table[_is_timed(table) & (table.episodes == table.episodes.max())]
    timed = timed.sort_values(["time_p99_us", "cost_ratio"])
    return timed[timed.cost_ratio < timed.cost_ratio.cummin().shift(fill_value=np.inf)]


def _set_logarithmic(axes: Axes) -> None:
    """Logarithmic axes with plain numbers, see :func:`_locator`."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(_locator(*axis.get_view_interval()))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_minor_locator(NullLocator())


def _locator(low: float, high: float) -> Locator:
    """Ticks at powers of ten, at 1, 2 and 5 where the values are close, and evenly where they are closer."""
    if high < EVEN * low:
        return MaxNLocator(8, steps=[1, 2, 2.5, 5, 10])
    return LogLocator(subs=(1.0, 2.0, 5.0) if high < CLOSE * low else (1.0,))


def _interval(axes: Axes, x: float, line: Any, **look: Any) -> Artist:
    """A point with the interval of its geometric mean."""
    below, above = line.excess - min(line.excess_low, line.excess), max(line.excess_high, line.excess) - line.excess
    return axes.errorbar([x], [line.excess], yerr=[[below], [above]], **look).lines[0]
