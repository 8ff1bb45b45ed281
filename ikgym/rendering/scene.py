"""The picture of an arm and its paths in space, with the error curves beside it.

Axes, grid and legend are drawn once an episode and kept as pixels. A frame restores them and draws only the moving
parts.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.ticker import MaxNLocator

from ikgym.rendering.error_curve import ErrorCurve
from ikgym.rendering.solid_lines import SolidLines
from ikgym.rendering.style import (
    BLUE,
    GREEN,
    INK,
    LARGE,
    MEDIUM,
    MIST,
    ORANGE,
    PALE,
    PALE_GREEN,
    PURPLE,
    SMALL,
    STEEL,
    VERMILION,
    stride,
    thinned,
)
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Colours of the tool's axes.
AXES = {"x": VERMILION, "y": GREEN, "z": PURPLE}
#: Their length, as a share of the longest side of the visible box.
FRAME = 0.14


class Scene:
    """The picture and its moving parts, see :class:`ikgym.rendering.Renderer`."""

    def __init__(self, figure: Figure, scenario: Scenario, title: str) -> None:
        self.figure, self._title = figure, title
        self._steps, self._duration = scenario.steps, scenario.steps * scenario.dt
        self._prismatic, self._has_orientation = scenario.arm.chain.prismatic, scenario.task.has_orientation
        self._background: Any = None
        figure.set_layout_engine("none")
        self._moving: list[Artist] = []
        self._space: Any = figure.add_axes((0.01, 0.165, 0.55, 0.78), projection="3d", proj_type="ortho")
        self._dress_space()
        # Drawn in this order: the thin actual path is seen on the wide nominal one, and both where they part.
        self._nominal = self._line("nominal path", color=PALE_GREEN, lw=4.0, solid_capstyle="butt")
        self._actual = self._line("actual path", color=BLUE, lw=1.3)
        self._links = self._line("links", color=STEEL, lw=4.0, solid_capstyle="round", solid_joinstyle="round")
        self._base = self._line("base", ls="", marker="^", ms=11, mfc=INK, mec=INK)
        # Dashes show the travel of a prismatic joint, the square (point 1 of each 3) its position.
        self._rails = self._line(
            "prismatic joint", color=ORANGE, lw=2.6, ls=(0, (1.6, 0.8)), marker="s", ms=7.5, mec=INK, markevery=(1, 3)
        )
        self._revolute = self._line("revolute joint", ls="", marker="o", ms=6, mfc="white", mec=INK, mew=1.3)
        self._tool = self._line("tool", ls="", marker="D", ms=5.5, mfc=VERMILION, mec=INK, mew=0.8)
        self._target = self._line("target", ls="", marker="o", ms=11, mfc="none", mec=GREEN, mew=1.6)
        self._frame = [self._line(f"tool {name}", color=colour, lw=2.0) for name, colour in AXES.items()]
        self._solids = SolidLines(scenario.arm, scenario.surroundings, self._line) if scenario.collides else None
        self._clearance, self._frame_length = math.inf, 0.0
        self._base.set_data_3d(np.zeros((3, 1)))
        self._curves = self._error_curves()
        self._heading = figure.text(0.02, 0.945, "", size=LARGE, weight="bold", parse_math=False)
        self._moving += [*(curve.line for curve in self._curves), self._heading]
        self._legend()
        if figure.canvas.supports_blit:
            for artist in self._moving:
                artist.set_animated(True)
            # A canvas also draws by itself, when its window is resized or the view turned.
            figure.canvas.mpl_connect("draw_event", self._keep_background)

    def set_stage(self, nominal: FloatArray, start: FloatArray, margin: float, boxes: FloatArray | None = None) -> None:
        """Sets the parts that are fixed during an episode.

        Args:
            nominal: The nominal positions in [m]. Shape (steps + 1, 3).
            start: Points of the arm at the start in [m]. Shape (any, 3).
            margin: Space around base, nominal path and start, in [m].
            boxes: The obstacles; None for those at the start. Shape (o, 16).
        """
        self._nominal.set_data_3d(thinned(nominal, stride(len(nominal))).T)
        points = np.vstack([np.zeros(3), start, nominal])
        if self._solids is not None:
            points = np.vstack([points, self._solids.extent(boxes)])
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        self._frame_length = FRAME * float((high - low).max())
        # Nothing is readable in a flat box.
        sides = np.maximum(high - low, 0.6 * (high - low).max())
        low, high = 0.5 * (low + high - sides), 0.5 * (low + high + sides)
        if self._solids is not None:
            self._solids.look(low, high)
        self._space.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        self._space.set_box_aspect(tuple(sides), zoom=0.95)  # which scales an array in place
        # One distance of ticks for all axes; none near an end, where it would run into those of the next axis.
        distance = np.diff(MaxNLocator(7, steps=[1, 2, 5, 10]).tick_values(0.0, 0.88 * sides.max()))[0]
        first, last = np.ceil((low + 0.06 * sides) / distance), np.floor((high - 0.06 * sides) / distance)
        for axis, a, b in zip((self._space.xaxis, self._space.yaxis, self._space.zaxis), first, last, strict=True):
            axis.set_ticks(distance * np.arange(a, b + 1))
        for curve in self._curves:
            curve.begin(self._duration)

    def set_arm(self, joints: FloatArray, rotation: FloatArray, tool: FloatArray, target: FloatArray) -> None:
        """Moves the arm.

        Args:
            joints: The two ends of each joint in [m]. Shape (n, 2, 3).
            rotation: Orientation of the tool. Shape (3, 3).
            tool: The tool points so far in [m]. Shape (k, 3).
            target: The nominal position in [m]. Shape (3,).
        """
        links, gap = [np.zeros(3)], np.full(3, np.nan)
        path = thinned(tool, stride(self._steps + 1))
        for (begin, end), prismatic in zip(joints, self._prismatic, strict=True):
            links += [begin, gap, end] if prismatic else [end]
        rails = joints[self._prismatic]
        self._links.set_data_3d(np.vstack([*links, path[-1]]).T)
        self._rails.set_data_3d(np.insert(rails, 2, np.nan, axis=1).reshape(-1, 3).T)
        self._revolute.set_data_3d(joints[~self._prismatic, 1].T)
        self._actual.set_data_3d(path.T)
        self._tool.set_data_3d(path[-1:].T)
        self._target.set_data_3d(target[:, None])
        if self._has_orientation:
            for line, axis in zip(self._frame, rotation.T, strict=True):
                line.set_data_3d(np.vstack([path[-1], path[-1] + self._frame_length * axis]).T)

    def set_solids(self, q: FloatArray, boxes: FloatArray | None) -> None:
        """Moves bodies and obstacles, if they are shown; boxes are None for those at the start."""
        if self._solids is not None:
            self._clearance = self._solids.show(q, boxes)

    def set_errors(self, time: FloatArray, errors: FloatArray) -> bool:
        """Moves the error curves on, and the heading; returns whether an axis changed, so that all is drawn anew.

        Args:
            time: The times so far in [s]. Shape (k,).
            errors: Errors of position in [m] and of orientation in [rad]. Shape (k, 2).
        """
        clearance = f",  clearance {1e3 * self._clearance:.1f} mm" if math.isfinite(self._clearance) else ""
        self._heading.set_text(f"{self._title},  t = {time[-1]:.3f} s{clearance}")
        changes = [curve.show(time, errors[:, i], stride(self._steps + 1)) for i, curve in enumerate(self._curves)]
        return any(changes)

    def paint(self, *, anew: bool) -> None:
        """Brings the picture up to date; all of it if a fixed part has changed."""
        canvas: Any = self.figure.canvas
        if anew or self._background is None:
            canvas.draw()
        else:
            canvas.restore_region(self._background)
            self._draw_moving()
            canvas.blit(self.figure.bbox)
        canvas.flush_events()

    def pixels(self) -> npt.NDArray[np.uint8]:
        """A copy of the picture in memory. Shape (HEIGHT, WIDTH, 3)."""
        canvas: Any = self.figure.canvas
        return np.array(np.asarray(canvas.buffer_rgba())[..., :3])

    def _keep_background(self, _: object) -> None:
        canvas: Any = self.figure.canvas
        self._background = canvas.copy_from_bbox(self.figure.bbox)
        self._draw_moving()

    def _draw_moving(self) -> None:
        for artist in self._moving:
            self.figure.draw_artist(artist)

    def _line(self, name: str, **style: Any) -> Any:
        (line,) = self._space.plot([], [], [], label=name, gid=name, zorder=len(self._moving), **style)
        self._moving.append(line)
        return line

    def _dress_space(self) -> None:
        space = self._space
        space.view_init(elev=24, azim=-58)
        space.tick_params(labelsize=SMALL, pad=0)
        for axis, name in zip((space.xaxis, space.yaxis, space.zaxis), "xyz", strict=True):
            axis.set_label_text(f"{name} [m]", size=MEDIUM)
            axis.pane.set(facecolor=PALE, edgecolor=MIST)
            # The only other way to the grid's colour is rcParams, which belong to the user.
            axis._axinfo["grid"].update(color=MIST, linewidth=0.6)

    def _error_curves(self) -> list[ErrorCurve]:
        kinds = [("position error", "m", BLUE), ("orientation error", "rad", VERMILION)][: 1 + self._has_orientation]
        bottom, top, gap = 0.115, 0.93, 0.06
        self.figure.text(0.8175, 0.025, "time [s]", size=MEDIUM, ha="center")
        pitch = (top - bottom + gap) / len(kinds)
        return [
            ErrorCurve(
                self.figure.add_axes((0.66, top + gap - i * pitch, 0.315, pitch - gap)), *kind, last=i == len(kinds)
            )
            for i, kind in enumerate(kinds, start=1)
        ]

    def _legend(self) -> None:
        joints = [self._revolute, self._rails] if self._prismatic.any() else [self._revolute]
        if self._prismatic.all():
            joints = [self._rails]
        handles: list[Any] = [self._base, *joints, self._tool, self._target, self._nominal, self._actual]
        labels = [handle.get_label() for handle in handles]
        if self._has_orientation:
            handles, labels = [*handles, tuple(self._frame)], [*labels, "tool x, y, z"]
        if self._solids is not None:
            handles, labels = (
                [*handles, *self._solids.lines],
                [*labels, *(one.get_label() for one in self._solids.lines)],
            )
        self.figure.legend(
            handles,
            labels,
            handler_map={tuple: HandlerTuple(ndivide=None, pad=0.3)},
            loc="lower left",
            bbox_to_anchor=(0.01, 0.0),
            ncols=4,
            fontsize=SMALL,
            frameon=False,
            columnspacing=1.5,
            handletextpad=0.6,
        )
