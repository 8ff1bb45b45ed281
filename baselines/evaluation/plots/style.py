"""The style of all plots, and their files."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import PIL.Image
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import MaxNLocator

# Okabe and Ito's colours, which colour-blind readers can distinguish, without yellow, which is invisible on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A4B1E", "#222222")
DASHES = ("-", "--", ":")
INK, STEEL, MIST = "#222222", "#6e6e6e", "#dddddd"
WIDTH, DPI = 7.6, 150  # [in], [px/in]
SMALL, MEDIUM = 8.0, 9.0  # letters, in [pt]
LETTERS, LINE = 115, 10  # small ones that fit the width, and those that a legend's line and gaps are worth


def figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure in [in], without pyplot, which needs a window system and keeps figures alive."""
    out = Figure(figsize=(width, height), dpi=DPI, layout=ConstrainedLayoutEngine(h_pad=0.05, w_pad=0.06))
    FigureCanvasAgg(out)
    return out


def png(drawn: Figure) -> bytes:
    """The figure as PNG; the same bytes for the same figure."""
    # `savefig` would draw a figure with a layout engine twice, the first time to have it laid out, which one drawing
    # does as well.
    canvas: Any = drawn.canvas
    canvas.draw()
    out = io.BytesIO()
    PIL.Image.fromarray(np.asarray(canvas.buffer_rgba())).save(out, format="png", dpi=(DPI, DPI))
    return out.getvalue()


def small_png(drawn: Figure) -> bytes:
    """The figure as PNG with a palette, a third as large, for files under version control."""
    out = io.BytesIO()
    PIL.Image.open(io.BytesIO(png(drawn))).convert("RGB").quantize(256).save(out, format="png", optimize=True)
    return out.getvalue()


def literal(text: str) -> str:
    """A text that matplotlib shows letter by letter: a formula between dollars in a name may be none."""
    return text.replace("$", r"\$")


def dress(axes: Axes, *, ylabel: str, xlabel: str = "", title: str = "", ticks: int = 8) -> None:
    """Labels, a pale grid and no frame but the axes."""
    axes.set_ylabel(ylabel, fontsize=MEDIUM)
    axes.set_xlabel(xlabel, fontsize=MEDIUM)
    axes.set_title(title, fontsize=MEDIUM, loc="left")
    axes.tick_params(labelsize=SMALL, color=STEEL, length=3)
    if axes.get_xscale() == "linear":
        axes.xaxis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.get_offset_text().set_fontsize(SMALL)
    axes.grid(color=MIST, lw=0.5)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(STEEL)


def looks(number: int) -> dict[str, Any]:
    """Colour and dashes of the number-th of many lines."""
    dash, colour = list(product(DASHES, COLOURS))[number % (len(DASHES) * len(COLOURS))]
    return {"color": colour, "linestyle": dash}


def legend(drawn: Figure, title: str, handles: Sequence[Artist], names: Sequence[str]) -> None:
    """Title and legend above all axes."""
    lengths = [len(re.sub(r"\$[^$]*\$", "qi", name)) + LINE for name in names]  # formulas are short once typeset
    # A legend fills its columns one after the other, each as wide as its longest name.
    fits = (n for n in range(len(names), 0, -1) if sum(map(max, np.array_split(lengths, n))) <= LETTERS)
    across = int(next(fits, 1))
    drawn.legend(
        handles,
        names,
        loc="outside upper center",
        ncols=across,
        title=title,
        title_fontsize=MEDIUM + 1,
        fontsize=SMALL,
        frameon=False,
        handlelength=2.4,
    )
