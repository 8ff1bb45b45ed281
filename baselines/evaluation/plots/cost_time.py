"""Cost, or cost ratio, against time per step: what a policy is worth and what it takes."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from baselines.evaluation.metrics import Spread, Summary
from baselines.evaluation.plots import style
from ikgym.validation import FloatArray

# Where a label may stand, seen from its point, in [pt], the nicest first: beside it, above, below, farther away.
NEAR, STEPS_OUT = 7.0, (1.0, 2.0, 3.2, 4.6, 6.5)
DIRECTIONS = (
    *((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)),
    *((1, 0.5), (1, -0.5), (-1, 0.5), (-1, -0.5), (0.5, 1), (0.5, -1), (-0.5, 1), (-0.5, -1)),
)
# What it costs that a line runs through a label, at each of its points, in [px²] of labels that overlap.
CROSSING = 200.0
GAP = 2.0  # around labels and points, in [px]
SMALLEST = 1e-12  # a cost of 0 has no place on a logarithmic axis
NEAREST = 1e-4  # by how much a cost ratio exceeds 1 at the lower end of its axis at most
# Keeps a label readable where a line runs behind it.
HALO = withStroke(linewidth=2.0, foreground="white", alpha=0.8)
REFERENCE = "reference: knows what no observation shows"


@dataclasses.dataclass(frozen=True)
class Mark:
    """A policy in the picture.

    Args:
        time: Median time per step, in [µs].
        value: Its cost, or its cost ratio.
        name: What to call it; a reference ends in a star.
        colour: Of its point.
        small: Whether it is a member of a family, whose line tells what it is: its point and its name are small.
    """

    time: float
    value: Spread
    name: str
    colour: str
    small: bool = False

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
    scatter(axes, marks, cost_ratio=known, several=any(summary.episodes > 1 for summary in summaries))
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


def scatter(axes: Axes, marks: Sequence[Mark], *, cost_ratio: bool, several: bool, room: float = 0.25) -> None:
    """Points on logarithmic axes, with bars to the 90th percentile and to the worst where there are several episodes.

    The axis of the cost ratio is logarithmic in what it exceeds 1 by: there 1.01 and 1.1 are as far apart as 2 and 11.

    Args:
        axes: An empty panel.
        marks: The points.
        cost_ratio: Whether values are cost ratios; costs if not.
        several: Whether there are several episodes.
        room: To be left around the points, as a share of their span.
    """
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
        face = "white" if mark.reference else mark.colour
        size = 4.5 if mark.small else 7.0
        axes.plot(
            mark.time, mean, "D" if mark.reference else "o", ms=size, color=mark.colour, mfc=face, mew=1.6, zorder=3.0
        )
    style.dress(
        axes,
        xlabel="median time per step [µs]",
        ylabel=("cost ratio [1]" if cost_ratio else "total cost [1]") + (", geometric mean" if several else ""),
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


def label(drawn: Figure, marks: Sequence[Mark], lines: Sequence[Sequence[Mark]] = ()) -> None:
    """Writes each name beside its point, so that no two names, nor a name and a point, overlap where that can be.

    Args:
        drawn: A figure with one panel and its points.
        marks: The points.
        lines: Points that are connected; names keep off the lines, too.
    """
    axes = drawn.axes[0]
    drawn.draw_without_rendering()  # settles the layout, which the sizes depend on
    assert isinstance(drawn.canvas, FigureCanvasAgg)  # style.figure gave it
    renderer = drawn.canvas.get_renderer()  # type: ignore[no-untyped-call]  # no annotations in matplotlib
    pixels = drawn.dpi / 72.0
    cost_ratio = axes.get_yscale() != "log"
    points = [(mark.time, height(mark.value.mean, cost_ratio=cost_ratio)) for mark in marks]
    spots = dict(zip(map(id, marks), map(axes.transData.transform, points), strict=True))
    dots = {
        key: Bbox.from_bounds(x - 5 * pixels, y - 5 * pixels, 10 * pixels, 10 * pixels) for key, (x, y) in spots.items()
    }
    frame = axes.get_window_extent(renderer)
    written: list[Bbox] = []
    leaders = [
        spot for line in lines for a, b in itertools.pairwise(line) for spot in _between(spots[id(a)], spots[id(b)])
    ]
    for mark, point in zip(marks, points, strict=True):
        spot = spots[id(mark)]
        text = axes.annotate(
            mark.name,
            point,
            xytext=(0.0, 0.0),
            textcoords="offset points",
            fontsize=style.SMALL - (0.5 if mark.small else 0.0),
            color=mark.colour if mark.small else style.INK,
            arrowprops={"arrowstyle": "-", "color": mark.colour, "lw": 0.7, "shrinkA": 0, "shrinkB": 4},
            zorder=4.0,
            path_effects=[HALO],
        )
        others = [dot for key, dot in dots.items() if key != id(mark)]
        best: tuple[float, tuple[float, float]] = (math.inf, (0.0, 0.0))
        for out, direction in itertools.product(STEPS_OUT, DIRECTIONS):
            offset = (NEAR * out * direction[0], NEAR * out * direction[1])
            box = _place(text, offset, renderer)
            leader = _leader(spot, offset, pixels)
            badness = 0.1 * math.hypot(*offset) + sum(_shared(box, dot) for dot in others)
            badness += 10.0 * sum(_shared(box, other) for other in written)
            badness += 10.0 * (box.width * box.height - _shared(box, frame))
            badness += CROSSING * sum(box.contains(*spot) for spot in leaders)
            badness += CROSSING * sum(other.contains(*spot) for spot in leader for other in written)
            if badness < best[0] - 1e-6:
                best = (badness, offset)
        written.append(_place(text, best[1], renderer))
        far = _leader(spot, best[1], pixels)
        leaders += far
        if not far:
            assert text.arrow_patch is not None  # there are arrowprops
            text.arrow_patch.set_visible(False)


def _between(a: FloatArray, b: FloatArray) -> list[tuple[float, float]]:
    """Points of the line between two points, half a label apart, in [px]."""
    count = 1 + math.ceil(math.dist(a, b) / 8.0)
    return [(a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])) for s in np.linspace(0.0, 1.0, count)]


def _leader(spot: FloatArray, offset: tuple[float, float], pixels: float) -> list[tuple[float, float]]:
    """Points of the line from a point to its label, in [px]; none where the label stands so near that there is none."""
    if math.hypot(*offset) <= 1.2 * NEAR:
        return []
    shares = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    return [(spot[0] + s * offset[0] * pixels, spot[1] + s * offset[1] * pixels) for s in shares]


def _place(text: Annotation, offset: tuple[float, float], renderer: RendererBase) -> Bbox:
    """Moves a label to an offset from its point; the box that it takes then, in [px]."""
    dx, dy = offset
    text.set_position(offset)
    text.set_horizontalalignment("left" if dx > 0 else "right" if dx < 0 else "center")
    text.set_verticalalignment("bottom" if dy > 0 else "top" if dy < 0 else "center")
    text.update_positions(renderer)
    # The label alone: an Annotation's own extent takes in its leader.
    return Text.get_window_extent(text, renderer).padded(GAP)


def _shared(a: Bbox, b: Bbox) -> float:
    """The area that two boxes share, in [px²]."""
    width = min(a.x1, b.x1) - max(a.x0, b.x0)
    height = min(a.y1, b.y1) - max(a.y0, b.y0)
    return float(max(width, 0.0) * max(height, 0.0))
