"""Limits of an arm in plots over time: what lies beyond them is shaded."""

from __future__ import annotations

from matplotlib.artist import Artist
from matplotlib.axes import Axes

#: What the shade is called in legends.
NAME = "beyond the limits"
COLOUR = "#f3d3c8"
# Limits further off than this share of what is seen stay out of sight: they would flatten all else.
NEAR, EDGE = 0.5, 0.04


def shade(axes: Axes, lower: float, upper: float) -> list[Artist]:
    """Shades what lies beyond two limits, where they are near.

    Args:
        axes: What has been drawn already says what is near; it stays in sight.
        lower: The lower limit, -inf where there is none.
        upper: The upper limit, inf where there is none.

    Returns:
        The shaded bands.
    """
    low, high = axes.get_ylim()
    near, edge = NEAR * (high - low), EDGE * (high - low)
    below, above = lower > low - near, upper < high + near
    bottom, top = min(low, lower - edge) if below else low, max(high, upper + edge) if above else high
    bands = [axes.axhspan(bottom, lower, color=COLOUR, lw=0, zorder=0)] if below else []
    bands += [axes.axhspan(upper, top, color=COLOUR, lw=0, zorder=0)] if above else []
    axes.set_ylim(bottom, top)
    return list(bands)
