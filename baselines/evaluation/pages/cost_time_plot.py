"""Cost ratio against time per step, with the families of the receding horizon as lines and the Pareto front behind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from baselines.evaluation.plots import style
from baselines.evaluation.plots.cost_time import COST_RATIO, Mark, height, label, scatter

FRONT = "#cfcfcf"


def draw(
    title: str,
    marks: Sequence[Mark],
    families: Mapping[str, Sequence[Mark]],
    front: Sequence[Mark],
    *,
    quantity: str,
    several: bool,
    deadline: float,
) -> Figure:
    """The picture of many policies: families as lines through their members, and the front that nobody beats.

    Args:
        title: Stands above it.
        marks: Policies that stand for themselves.
        families: The members of each family, from short to long.
        front: Those that no other beats in time or value without being worse in the other, from fast to slow.
        quantity: What the values are, in words.
        several: Whether there are several episodes, so that bars show their spread.
        deadline: The time that a step may take, in [µs].
    """
    drawn = style.figure(6.8)
    axes = drawn.subplots()
    members = [member for of in families.values() for member in of]
    scatter(axes, [*members, *marks], quantity=quantity, several=several, room=0.12)
    cost_ratio = quantity == COST_RATIO
    handles: list[Artist] = []
    for of in families.values():
        xs, ys = [m.time for m in of], [height(m.value.mean, cost_ratio=cost_ratio) for m in of]
        handles += axes.plot(xs, ys, color=of[0].colour, lw=1.5, marker="o", ms=4.5, zorder=2.5)
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
    handles.append(stairs[0])
    names = [*(f"{name}, by horizon" for name in families), "Pareto front"]
    if several:
        handles += [Line2D([], [], color=style.STEEL, lw=2.4), Line2D([], [], color=style.STEEL, lw=0.7, marker="_")]
        names += ["mean to 90th percentile", "and on to the worst"]
    style.legend(drawn, title, handles, names)
    drawn.legend(
        [Line2D([], [], color=mark.colour, marker=mark.marker, ls="", ms=6) for mark in marks],
        [mark.name for mark in marks],
        loc="outside right center",
        fontsize=style.SMALL - 0.5,
        frameon=False,
        handlelength=1.0,
    )
    # Named are the front, and of each family the shortest and the longest horizon; legend and table have the others.
    ends = [member for of in families.values() for member in (of[0], of[-1])]
    named = list({id(mark): mark for mark in (*front, *ends)}.values())
    label(drawn, named, [mark for mark in (*members, *marks) if mark not in named])
    return drawn
