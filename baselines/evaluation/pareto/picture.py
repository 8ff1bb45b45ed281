"""Cost ratio against time per step, with the families of the receding horizon as lines and the Pareto front behind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from baselines.evaluation.plots import style
from baselines.evaluation.plots.cost_time import Mark, height, label, scatter

FRONT = "#cfcfcf"


def draw(
    title: str,
    marks: Sequence[Mark],
    families: Mapping[str, Sequence[Mark]],
    front: Sequence[Mark],
    *,
    cost_ratio: bool,
    several: bool,
    deadline: float,
) -> Figure:
    """The picture of many policies: families as lines through their members, and the front that nobody beats.

    Args:
        title: Stands above it.
        marks: Policies that stand for themselves.
        families: The members of each family, from short to long.
        front: Those that no other beats in time or value without being worse in the other, from fast to slow.
        cost_ratio: Whether values are cost ratios; costs if not.
        several: Whether there are several episodes, so that bars show their spread.
        deadline: The time that a step may take, in [µs].
    """
    drawn = style.figure(6.8)
    axes = drawn.subplots()
    # Members first: their names are short and belong close to them.
    everyone = [*(member for members in families.values() for member in members), *marks]
    scatter(axes, everyone, cost_ratio=cost_ratio, several=several, room=0.12)
    handles: list[Artist] = []
    for members in families.values():
        xs, ys = [m.time for m in members], [height(m.value.mean, cost_ratio=cost_ratio) for m in members]
        handles += axes.plot(xs, ys, color=members[0].colour, lw=1.5, marker="o", ms=4.5, zorder=2.5)
    # A staircase: up to the time of the next one this is the best that is to be had.
    xs = [*(mark.time for mark in front for _ in "12"), axes.get_xlim()[1]][1:]
    ys = [height(mark.value.mean, cost_ratio=cost_ratio) for mark in front for _ in "12"]
    stairs = axes.plot(xs, ys, color=FRONT, lw=5.0, solid_joinstyle="round", solid_capstyle="butt", zorder=1.5)
    if axes.get_xlim()[0] < deadline < axes.get_xlim()[1]:
        axes.axvline(deadline, color=style.STEEL, lw=1.0, ls=(0, (4, 3)), zorder=1.2)
        axes.annotate(
            f"deadline, {deadline / 1e3:g} ms",
            (deadline, 1.0),
            xytext=(-3, -3),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            ha="right",
            va="top",
            rotation=90,
            fontsize=style.SMALL - 0.5,
            color=style.STEEL,
        )
    dot = Line2D([], [], color=style.STEEL, marker="o", ls="", ms=6)
    entries: list[tuple[Artist, str]] = [
        *((handle, f"{name}, by horizon") for handle, name in zip(handles, families, strict=True)),
        (dot, "other policies"),
        (stairs[0], "Pareto front"),
    ]
    if several:
        entries.append((Line2D([], [], color=style.STEEL, lw=2.4), "mean to 90th percentile"))
        entries.append((Line2D([], [], color=style.STEEL, lw=0.7, marker="_", ms=5), "and on to the worst"))
    style.legend(drawn, title, [handle for handle, _ in entries], [name for _, name in entries])
    label(drawn, everyone, list(families.values()))
    return drawn
