"""Joint velocities and joint paths of one policy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.evaluation.plots import bands, style
from ikgym.validation import FloatArray

Series = Mapping[str, npt.NDArray[Any]]


def draw_velocities(title: str, log: Series) -> Figure:
    """Joint velocities over the episode, and closer where they fluctuate most; limits as bands and dotted lines."""
    time, qdot, prismatic = log["time"], log["qdot"], log["prismatic"]
    window = busiest(qdot)
    drawn = style.figure(4.6)
    whole, close = drawn.subplots(2, 1)
    for joint in range(qdot.shape[1]):
        for axes, part in ((whole, slice(None)), (close, window)):
            marks: dict[str, Any] = {"marker": ".", "ms": 3.0} if axes is close else {}
            axes.plot(time[part], qdot[part, joint], lw=0.9, **style.looks(joint), **marks)
    edges = time[window][[0, -1]]
    whole.axvspan(*edges, color=style.MIST, lw=0, zorder=0)
    unit = "[m/s]" if prismatic.all() else "[rad/s], [m/s]" if prismatic.any() else "[rad/s]"
    dotted = "; dotted: limits of the joints" if np.isfinite(log["velocity_limit"]).any() else ""
    for axes, panel in ((whole, f"whole episode; shaded: the part below{dotted}"), (close, "where it fluctuates most")):
        style.dress(axes, ylabel=f"velocity {unit}", title=panel)
        axes.margins(x=0.01)
    close.set_xlabel("time [s]", fontsize=style.MEDIUM)
    names = [rf"$\dot q_{{{j + 1}}}$" + (" [m/s]" if linear else "") for j, linear in enumerate(prismatic)]
    handles: list[Artist] = [*whole.get_lines()]
    shaded = [band for axes in (whole, close) for band in _draw_limits(axes, log["velocity_limit"])]
    style.legend(drawn, title, handles + shaded[:1], names + [bands.NAME] * bool(shaded))
    return drawn


def _draw_limits(axes: Axes, fastest: FloatArray) -> list[Artist]:
    """Draws the velocity limits that are near, and gives the bands beyond the largest."""
    peak = max(map(abs, axes.get_ylim()))
    for joint in np.flatnonzero(fastest < (1.0 + bands.NEAR) * peak).tolist():
        for limit in (-fastest[joint], fastest[joint]):
            axes.axhline(limit, color=style.looks(joint)["color"], lw=0.7, ls=":", zorder=1)
    return bands.shade(axes, -fastest.max(), fastest.max())


def draw_paths(title: str, log: Series) -> Figure:
    """Joint coordinates over the episode, one panel a joint: actual, nominal where there are, and limits as bands."""
    time, q, nominal = log["time"], log["q"], log.get("nominal_q")
    lines: dict[str, Artist] = {}
    joints = q.shape[1]
    columns = 2 if joints > 3 else 1
    rows = -(-joints // columns)
    drawn = style.figure(0.9 + 1.25 * rows)
    grid = drawn.add_gridspec(rows, columns)
    for joint in range(joints):
        axes = drawn.add_subplot(grid[joint // columns, joint % columns])
        (lines["actual"],) = axes.plot(time, q[:, joint], color=style.COLOURS[0], lw=1.4)
        if nominal is not None:
            (lines["nominal"],) = axes.plot(time, nominal[:, joint], color=style.COLOURS[1], lw=1.2, ls=(0, (4, 3)))
        unit = "[m]" if log["prismatic"][joint] else "[rad]"
        last = joint + columns >= joints
        style.dress(axes, ylabel=rf"$q_{{{joint + 1}}}$ {unit}", xlabel="time [s]" if last else "", ticks=12 // columns)
        axes.margins(x=0.01)
        for band in bands.shade(axes, log["lower"][joint], log["upper"][joint]):
            lines[bands.NAME] = band
    drawn.align_ylabels()
    style.legend(drawn, title, list(lines.values()), list(lines))
    return drawn


def busiest(qdot: FloatArray) -> slice:
    """The twentieth part of an episode, though 50 to 150 steps, in which the velocities zigzag most.

    By the second differences: what rises and falls smoothly is no fluctuation.

    Args:
        qdot: Joint velocities. Shape (k, n).
    """
    length = min(max(50, len(qdot) // 20), 150, len(qdot))
    zigzag = np.zeros(len(qdot))
    if len(qdot) > 2:
        zigzag[1:-1] = np.abs(np.diff(qdot, n=2, axis=0)).sum(axis=1)
    # Weights that fall towards the ends bring a single peak to the middle.
    sums = np.convolve(zigzag, np.hanning(length + 2)[1:-1], mode="valid")
    start = int(np.argmax(sums))
    return slice(start, start + length)
