"""Joint velocities, joint paths and joint accelerations of one policy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

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
    limits = log["lower"], log["upper"]
    return _draw_joints(title, log, log["q"], limits, _Label("q", "[rad]", "[m]"), log.get("nominal_q"))


def draw_accelerations(title: str, log: Series) -> Figure:
    """Joint accelerations over the episode, one panel a joint, and limits as bands."""
    limits = -log["acceleration_limit"], log["acceleration_limit"]
    return _draw_joints(title, log, log["qddot"], limits, _Label(r"\ddot q", "[rad/s²]", "[m/s²]"))


class _Label(NamedTuple):
    """What is drawn of a joint: its symbol, and its units where the joint turns and where it is prismatic."""

    symbol: str
    turning: str
    prismatic: str


def _draw_joints(
    title: str,
    log: Series,
    actual: FloatArray,
    limits: tuple[FloatArray, FloatArray],
    label: _Label,
    nominal: FloatArray | None = None,
) -> Figure:
    """One panel a joint; values of shape (k, n), limits of shape (n,)."""
    lines: dict[str, Artist] = {}
    joints = actual.shape[1]
    columns = 2 if joints > 3 else 1
    rows = -(-joints // columns)
    drawn = style.figure(0.9 + 1.25 * rows)
    grid = drawn.add_gridspec(rows, columns)
    for joint in range(joints):
        axes = drawn.add_subplot(grid[joint // columns, joint % columns])
        (lines["actual"],) = axes.plot(log["time"], actual[:, joint], color=style.COLOURS[0], lw=1.4)
        if nominal is not None:
            dashed: dict[str, Any] = {"color": style.COLOURS[1], "lw": 1.2, "ls": (0, (4, 3))}
            (lines["nominal"],) = axes.plot(log["time"], nominal[:, joint], **dashed)
        unit = label.prismatic if log["prismatic"][joint] else label.turning
        last = joint + columns >= joints
        axis = {"ylabel": rf"${label.symbol}_{{{joint + 1}}}$ {unit}", "xlabel": "time [s]" if last else ""}
        style.dress(axes, **axis, ticks=12 // columns)
        axes.margins(x=0.01)
        for band in bands.shade(axes, limits[0][joint], limits[1][joint]):
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
