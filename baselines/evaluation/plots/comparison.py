"""Plots of a table of results: cost against time, cost against foresight, and cost over two severities."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import FixedLocator, FuncFormatter, Locator, LogLocator, MaxNLocator, NullFormatter, NullLocator

from baselines.evaluation.plots import style
from baselines.evaluation.table import number

#: Excess costs below this are drawn here, in [%].
FLOOR = 0.01
#: Cost ratios above this have the colour of this one.
CUT = 100.0
#: Values within the first factor have several ticks a decade, within the second evenly spaced ones.
CLOSE, EVEN = 300.0, 4.0
#: One line of a table: the name of each column and its value, or the text of it.
Record = Mapping[str, Any]


def front(lines: Sequence[Record]) -> list[Record]:
    """The Pareto front, fast to slow: lines that no other beats in both 99th percentile of the time and cost ratio.

    Lines without times, or with fewer episodes than others, are left out.
    """
    most = max(int(line["episodes"]) for line in lines)
    timed = [line for line in lines if _timed(line) and int(line["episodes"]) == most]
    out: list[Record] = []
    for line in sorted(timed, key=lambda line: (float(line["time_p99_us"]), float(line["cost_ratio"]))):
        if not out or float(line["cost_ratio"]) < float(out[-1]["cost_ratio"]):
            out.append(line)
    return out


def _timed(line: Record) -> bool:
    return math.isfinite(_number(line["time_p99_us"])) and math.isfinite(_number(line["cost_ratio"]))


def _number(cell: object) -> float:
    """The number in a cell; NaN in an empty one."""
    return math.nan if cell in ("", None) else float(str(cell))


def cost_time(lines: Sequence[Record], title: str) -> Figure:
    """Excess cost against the 99th percentile of the time per call, with intervals and the Pareto front.

    All policies have a name in the legend if there are colours enough; else those of the front.
    """
    drawn = style.figure(4.6)
    axes = drawn.subplots()
    timed, best = [line for line in lines if _timed(line)], front(lines)
    named = timed if len(timed) <= len(style.COLOURS) else best
    for line in timed:
        if line not in named:
            _interval(axes, float(line["time_p99_us"]), line, color=style.STEEL, marker="o", ms=3.5, lw=0.8)
    times, excess = [float(line["time_p99_us"]) for line in best], [_excess(line["cost_ratio"]) for line in best]
    axes.step(times, excess, where="post", color=style.MIST, lw=3.0, zorder=1)
    points = []
    for place, line in enumerate(named):
        look = {"color": style.looks(place)["color"], "marker": "osD^v"[place % 5]}
        points.append(_interval(axes, float(line["time_p99_us"]), line, ms=7.0, lw=1.2, ls="", **look))
    _logarithmic(axes)
    style.dress(axes, xlabel="time of a call, 99th percentile [µs]", ylabel="cost above the reference [%]")
    title = style.literal(f"{title}: cost against time, and the Pareto front")
    style.legend(drawn, title, points, [style.literal(str(one["policy"])) for one in named])
    return drawn


def foresight(lines: Sequence[Record], title: str, by: str) -> Figure:
    """Excess cost against foresight, with intervals: a panel per scenario, a series per value of the column `by`."""
    drawn = style.figure(3.4)
    scenarios = list(dict.fromkeys(line["scenario"] for line in lines))
    panels = drawn.subplots(1, len(scenarios), squeeze=False)[0]
    series = list(dict.fromkeys(line[by] for line in lines))
    for axes, scenario in zip(panels, scenarios, strict=True):
        here = [line for line in lines if line["scenario"] == scenario]
        handles = []
        for place, value in enumerate(series):
            some = sorted((line for line in here if line[by] == value), key=lambda line: int(line["foresight"]))
            ahead = np.array([int(line["foresight"]) for line in some])
            handles += axes.plot(ahead, [_excess(line["cost_ratio"]) for line in some], lw=1.4, **style.looks(place))
            for steps, line in zip(ahead, some, strict=True):
                _interval(axes, float(steps), line, marker="o", ms=4.5, color=style.looks(place)["color"])
        _logarithmic(axes)
        axes.xaxis.set_major_locator(FixedLocator(sorted({int(line["foresight"]) for line in here})))
        style.dress(
            axes, xlabel="foresight [steps]", ylabel="cost above the reference [%]", title=style.literal(str(scenario))
        )
    names = [style.literal(f"{by.replace('_', ' ')}: {value}") for value in series]
    style.legend(drawn, title, handles, names)
    return drawn


def severity_map(lines: Sequence[Record]) -> Figure:
    """Cost ratios over two severities of the plant, one panel per policy; below them the share of lost episodes."""
    policies = list(dict.fromkeys(str(line["policy"]) for line in lines))
    across = min(len(policies), 2)
    down = -(-len(policies) // across)
    drawn = style.figure(3.4 * down + 0.4, 3.8 * across + 0.8)
    panels = drawn.subplots(down, across, squeeze=False).ravel()
    shades = [
        _severities(axes, policy, [line for line in lines if line["policy"] == policy])
        for axes, policy in zip(panels, policies, strict=False)
    ]
    for axes in panels[len(policies) :]:
        axes.set_visible(False)
    bar = drawn.colorbar(shades[0], ax=panels.tolist(), shrink=0.7, extend="max")
    bar.set_label("cost ratio", fontsize=style.SMALL)
    bar.ax.tick_params(labelsize=style.SMALL)
    return drawn


def _severities(axes: Axes, policy: str, lines: Sequence[Record]) -> AxesImage:
    knowledge, drives = (sorted({float(line[name]) for line in lines}) for name in ("knowledge", "drives"))
    ratios = np.full((len(drives), len(knowledge)), np.nan)
    for line in lines:
        x, y, ratio = knowledge.index(float(line["knowledge"])), drives.index(float(line["drives"])), line["cost_ratio"]
        ratios[y, x] = float(ratio)
        lost = float(line["lost_percent"])
        text = number(float(ratio)) + (f"\n{lost:.0f} % lost" if lost else "")
        colour = "white" if float(ratio) > np.sqrt(CUT) else style.INK
        axes.text(x, y, text, ha="center", va="center", fontsize=style.SMALL, color=colour)
    shade = axes.imshow(np.clip(ratios, 1.0, CUT), norm=LogNorm(1.0, CUT), cmap="viridis_r", origin="lower")
    axes.set_title(style.literal(policy), fontsize=style.MEDIUM, loc="left")
    axes.set_xticks(range(len(knowledge)), [f"{one:g}" for one in knowledge], fontsize=style.SMALL)
    axes.set_yticks(range(len(drives)), [f"{one:g}" for one in drives], fontsize=style.SMALL)
    axes.set_xlabel("severity of calibration, payload and camera", fontsize=style.SMALL)
    axes.set_ylabel("severity of lag and delay", fontsize=style.SMALL)
    return shade


def _locator(low: float, high: float) -> Locator:
    """Ticks at powers of ten, at 1, 2 and 5 where the values are close, and evenly where they are closer."""
    if high < EVEN * low:
        return MaxNLocator(8, steps=[1, 2, 2.5, 5, 10])
    return LogLocator(subs=(1.0, 2.0, 5.0) if high < CLOSE * low else (1.0,))


def _logarithmic(axes: Axes) -> None:
    """Logarithmic axes with plain numbers, see :func:`_locator`."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        axis.set_major_locator(_locator(low, high))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_minor_locator(NullLocator())


def _excess(cost_ratio: object) -> float:
    """The cost above the reference, in [%]."""
    return max(100.0 * (_number(cost_ratio) - 1.0), FLOOR)


def _interval(axes: Axes, x: float, line: Record, **look: Any) -> Artist:
    """A point with the interval of its geometric mean."""
    middle = _excess(line["cost_ratio"])
    low, high = (middle if math.isnan(_number(line[name])) else _excess(line[name]) for name in ("low", "high"))
    lengths = [[middle - min(low, middle)], [max(high, middle) - middle]]
    return axes.errorbar([x], [middle], yerr=lengths, **look).lines[0]
