"""Total cost against time per step: what a policy is worth and what it takes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

from matplotlib.axis import Axis
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from baselines.metrics import Summary
from baselines.plots import style
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


def draw(
    title: str, summaries: Sequence[Summary], names: Mapping[int, str], looks: Mapping[int, Mapping[str, str]]
) -> Figure:
    """The picture.

    Args:
        title: Stands above it.
        summaries: The results of one scenario; those without times have no place. At least one has some.
        names: What to call them, by their ids; a reference ends in a star.
        looks: Their colours, by their ids.
    """
    drawn = style.figure(4.2, 6.4)
    axes = drawn.subplots()
    axes.set_xscale("log")
    axes.set_yscale("log")
    points = []
    timed = [(summary, summary.time_p50_us) for summary in summaries if summary.time_p50_us is not None]
    for summary, x in timed:
        y = max(summary.total_cost.mean, SMALLEST)
        colour = looks[id(summary)]["color"]
        hollow = names[id(summary)].endswith("*")
        axes.plot(x, y, "D" if hollow else "o", ms=7, color=colour, mfc="white" if hollow else colour, mew=1.6)
        points.append((x, y))
    several = any(summary.episodes > 1 for summary in summaries)
    style.dress(
        axes,
        title=title,
        xlabel="median time per step [µs]",
        ylabel="total cost [1]" + (", geometric mean" if several else ""),
    )
    if any(name.endswith("*") for name in names.values()):
        axes.annotate(
            "◇ * reference: knows the nominal joint path",
            (1.0, 1.01),
            xycoords="axes fraction",
            ha="right",
            va="bottom",
            fontsize=style.SMALL - 1,
            color=style.STEEL,
        )
    axes.set_xlim(*_room([x for x, _ in points]))
    axes.set_ylim(*_room([y for _, y in points]))
    _ticks(axes.xaxis)
    _ticks(axes.yaxis)
    axes.grid(which="minor", color=style.MIST, lw=0.25)
    _label(drawn, points, [names[id(s)] for s, _ in timed], [looks[id(s)]["color"] for s, _ in timed])
    return drawn


def _room(values: Sequence[float]) -> tuple[float, float]:
    """Limits with a quarter of the span around the values, and a decade at least."""
    low, high = math.log10(min(values)), math.log10(max(values))
    margin = max(0.25 * (high - low), 0.5)
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


def _label(drawn: Figure, points: Sequence[tuple[float, float]], names: Sequence[str], colours: Sequence[str]) -> None:
    """Writes each name beside its point, so that no two names, nor a name and a point, overlap where that can be."""
    axes = drawn.axes[0]
    drawn.draw_without_rendering()  # settles the layout, which the sizes depend on
    assert isinstance(drawn.canvas, FigureCanvasAgg)  # style.figure gave it
    renderer = drawn.canvas.get_renderer()  # type: ignore[no-untyped-call]  # no annotations in matplotlib
    pixels = drawn.dpi / 72.0
    spots = [axes.transData.transform(point) for point in points]
    dots = [Bbox.from_bounds(x - 5 * pixels, y - 5 * pixels, 10 * pixels, 10 * pixels) for x, y in spots]
    frame = axes.get_window_extent(renderer)
    written: list[Bbox] = []
    leaders: list[tuple[float, float]] = []
    for number, (point, name, colour) in enumerate(zip(points, names, colours, strict=True)):
        text = axes.annotate(
            name,
            point,
            xytext=(0.0, 0.0),
            textcoords="offset points",
            fontsize=style.SMALL,
            color=style.INK,
            arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.7, "shrinkA": 0, "shrinkB": 4},
        )
        others = dots[:number] + dots[number + 1 :]
        best: tuple[float, tuple[float, float]] = (math.inf, (0.0, 0.0))
        for out, direction in itertools.product(STEPS_OUT, DIRECTIONS):
            offset = (NEAR * out * direction[0], NEAR * out * direction[1])
            box = _place(text, offset, renderer)
            leader = _leader(spots[number], offset, pixels)
            badness = 0.1 * math.hypot(*offset) + sum(_shared(box, dot) for dot in others)
            badness += 10.0 * sum(_shared(box, other) for other in written)
            badness += 10.0 * (box.width * box.height - _shared(box, frame))
            badness += CROSSING * sum(box.contains(*spot) for spot in leaders)
            badness += CROSSING * sum(other.contains(*spot) for spot in leader for other in written)
            if badness < best[0] - 1e-6:
                best = (badness, offset)
        written.append(_place(text, best[1], renderer))
        far = _leader(spots[number], best[1], pixels)
        leaders += far
        if not far:
            assert text.arrow_patch is not None  # there are arrowprops
            text.arrow_patch.set_visible(False)


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
