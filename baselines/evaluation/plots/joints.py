"""Joint velocities and joint paths of one policy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from baselines.evaluation.plots import style
from ikgym.validation import FloatArray

Series = Mapping[str, npt.NDArray[Any]]


def draw_velocities(title: str, log: Series) -> Figure:
    """Joint velocities over the episode, and closer where they fluctuate most."""
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
    for axes, panel in ((whole, "whole episode; shaded: the part below"), (close, "where it fluctuates most")):
        style.dress(axes, ylabel=f"velocity {unit}", title=panel)
        axes.margins(x=0.01)
    close.set_xlabel("time [s]", fontsize=style.MEDIUM)
    names = [rf"$\dot q_{{{j + 1}}}$" + (" [m/s]" if linear else "") for j, linear in enumerate(prismatic)]
    style.legend(drawn, title, whole.get_lines(), names)
    return drawn


def draw_paths(title: str, log: Series) -> Figure:
    """Joint coordinates over the episode, one panel a joint: nominal and actual."""
    time, q, nominal = log["time"], log["q"], log["nominal_q"]
    joints = q.shape[1]
    columns = 2 if joints > 3 else 1
    rows = -(-joints // columns)
    drawn = style.figure(0.9 + 1.25 * rows)
    grid = drawn.add_gridspec(rows, columns)
    for joint in range(joints):
        axes = drawn.add_subplot(grid[joint // columns, joint % columns])
        (actual,) = axes.plot(time, q[:, joint], color=style.COLOURS[0], lw=1.4)
        (meant,) = axes.plot(time, nominal[:, joint], color=style.COLOURS[1], lw=1.2, ls=(0, (4, 3)))
        unit = "[m]" if log["prismatic"][joint] else "[rad]"
        last = joint + columns >= joints
        style.dress(axes, ylabel=rf"$q_{{{joint + 1}}}$ {unit}", xlabel="time [s]" if last else "", ticks=12 // columns)
        axes.margins(x=0.01)
    drawn.align_ylabels()
    style.legend(drawn, title, [actual, meant], ["actual", "nominal"])
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
