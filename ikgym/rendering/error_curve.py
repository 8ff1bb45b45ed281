"""An error over time on a logarithmic axis."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from ikgym.rendering.style import MEDIUM, MIST, SMALL, thinned
from ikgym.validation import FloatArray

SMALLEST, LARGEST = 1e-9, 1e99  # errors are clipped to this range, in [m] or [rad]


class ErrorCurve:
    """An error over time, on a logarithmic axis that grows by whole decades and never shrinks.

    The lowest axes of several, the last, show the times.
    """

    def __init__(self, axes: Any, name: str, unit: str, color: str, *, last: bool) -> None:
        self._axes, self._last = axes, last
        (self.line,) = axes.plot([], [], color=color, lw=1.2, marker="o", ms=4.5, markevery=[-1], gid=name)
        self.line.set_clip_on(False)  # the dot at its end may lie on the frame
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(numticks=6))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
        axes.set_ylabel(f"{name} [{unit}]", size=MEDIUM)
        axes.yaxis.set_label_coords(-0.16, 0.5)  # the same place, however wide the numbers
        axes.grid(color=MIST, lw=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=SMALL)

    def begin(self, duration: float) -> None:
        """Begins an episode of a duration in [s], with an axis without numbers until errors are known."""
        self._decades = (math.inf, -math.inf)
        self._axes.set(xlim=(0.0, duration), ylim=(1e-2, 1.0))
        self._axes.tick_params(labelbottom=self._last, labelleft=False)

    def show(self, time: FloatArray, error: FloatArray, step: int) -> bool:
        """Updates the curve by times in [s] and errors in [m] or [rad] so far, (k,); returns whether axes changed.

        A point is drawn for each stretch of so many steps.
        """
        known = self._decades
        error = error.clip(SMALLEST, LARGEST)
        # An error of 0 at the start would open the axis downwards.
        seen = error[1:] if error[0] == SMALLEST else error
        if len(seen):
            low = min(self._decades[0], math.floor(math.log10(seen.min())))
            high = max(self._decades[1], math.ceil(math.log10(seen.max())))
            # At least two decades, downwards where possible.
            low = max(min(low, high - 2), math.floor(math.log10(SMALLEST)))
            high = max(high, low + 2)
            if (low, high) != self._decades:
                self._decades = low, high
                self._axes.set_ylim(10.0**low, 10.0**high)
                self._axes.tick_params(labelleft=True)
            times, peaks = _peaks(time, error, step)
            self.line.set_data(times, np.maximum(peaks, 10.0**low))
        else:
            self.line.set_data([], [])
        return known != self._decades


def _peaks(time: FloatArray, error: FloatArray, step: int) -> tuple[FloatArray, FloatArray]:
    """The largest error of each stretch, so that no peak is lost, and the last error as it is."""
    starts = np.arange(0, len(time) - 1, step)
    peaks = np.maximum.reduceat(error[:-1], starts) if len(starts) else error[:0]
    return thinned(time, step), np.append(peaks, error[-1])
