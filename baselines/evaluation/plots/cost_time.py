"""Cost, or cost ratio, against time per step: which policy is worth its time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from baselines.evaluation.plots import style
from baselines.evaluation.summary import Summary

SMALLEST = 1e-12  # a cost of 0 has no place on a logarithmic axis
NEAREST = 1e-4  # smallest excess of a cost ratio over 1 on its axis


def draw(
    title: str, summaries: Sequence[Summary], names: Mapping[int, str], looks: Mapping[int, Mapping[str, str]]
) -> Figure:
    """The plot of a scenario: the cost ratio if it is known for all policies, else the total cost.

    The axis of the cost ratio is logarithmic in its excess over 1. Bars end at the worst episode.

    Args:
        title: The title.
        summaries: Summaries of one scenario; policies without times are left out. At least one has a time.
        names: Labels of the policies, by the summaries' ids; that of a reference ends in a star.
        looks: Colours of the policies, by the summaries' ids.
    """
    known = all(summary.cost_ratio is not None for summary in summaries)

    def height(value: float) -> float:
        return max(value - 1.0, NEAREST) if known else max(value, SMALLEST)

    drawn = style.figure(4.2, 6.4)
    axes = drawn.subplots()
    axes.set(xscale="log", yscale="log")
    points: list[Artist] = []
    labels: list[str] = []
    for summary in summaries:
        if summary.time_p50_us is None:
            continue
        spread, colour = (summary.cost_ratio if known else None) or summary.total_cost, looks[id(summary)]["color"]
        mean, worst = height(spread.mean), height(spread.worst)
        axes.plot([summary.time_p50_us] * 2, [mean, max(mean, worst)], color=colour, alpha=0.35, lw=1.5)
        hollow: dict[str, Any] = {"marker": "D", "mfc": "white", "mec": colour, "mew": 1.6}
        filled: dict[str, Any] = {"marker": "o", "mec": "white", "mew": 0.5}
        kind = hollow if names[id(summary)].endswith("*") else filled
        points += axes.plot(summary.time_p50_us, mean, ms=8.0, color=colour, ls="", **kind)
        labels.append(names[id(summary)])
    several = any(summary.episodes > 1 for summary in summaries)
    quantity = "cost ratio" if known else "total cost"
    style.dress(
        axes,
        xlabel="median time per step [µs]",
        ylabel=f"{quantity} [1]" + (", geometric mean" if several else ""),
    )
    axes.margins(0.1)
    if known:
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{1.0 + value:.6g}"))
    style.legend(drawn, title, points, labels)
    return drawn
