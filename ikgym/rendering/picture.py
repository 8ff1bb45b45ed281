"""The picture of a scene: the arm and its paths in space, with the errors over time at its right.

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
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from ikgym.obstacles.solids import cut_half_spaces, in_space, outline
from ikgym.rendering.scene import (
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
    Scene,
    stride,
    thin,
)
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Colours of the tool's axes.
AXES = {"x": VERMILION, "y": GREEN, "z": PURPLE}
#: Their length, as a share of the longest side of the visible box.
FRAME = 0.14
#: Space around base, path and start, as a share of the reach of the arm.
MARGIN = 0.08
SMALLEST, LARGEST = 1e-9, 1e99  # errors are clipped to this range, in [m] or [rad]


class Picture:
    """A figure of one scenario and its moving parts."""

    def __init__(self, figure: Figure, scenario: Scenario, title: str) -> None:
        self.figure, self._scenario, self._title = figure, scenario, title
        self._prismatic, self._has_orientation = scenario.arm.chain.prismatic, scenario.task.has_orientation
        self._stride, self._background = stride(scenario.steps + 1), None
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
        self._solids = self._add_solids() if scenario.collides else []
        self._base.set_data_3d(np.zeros((3, 1)))
        kinds = [("position error", "m", BLUE), ("orientation error", "rad", VERMILION)][: 1 + self._has_orientation]
        self._curves = self._add_curves(kinds)
        self._heading = figure.text(0.02, 0.945, "", size=LARGE, weight="bold", parse_math=False)
        self._moving += [*(curve.line for curve in self._curves), self._heading]
        self._add_legend()
        if figure.canvas.supports_blit:
            for artist in self._moving:
                artist.set_animated(True)
            # A canvas also draws by itself, when its window is resized or the view turned.
            figure.canvas.mpl_connect("draw_event", self._keep_background)

    def begin(self, start: Scene, nominal: FloatArray) -> None:
        """Sets the parts that are fixed during an episode.

        Args:
            start: The scene at the start.
            nominal: The nominal positions in [m]. Shape (steps + 1, 3).
        """
        self._nominal.set_data_3d(thin(nominal, stride(len(nominal))).T)
        arm = self._scenario.arm
        points = [np.zeros(3), start.joints.reshape(-1, 3), start.tool[1], nominal]
        if self._solids:
            reach, obstacles = arm.reach(np.zeros(arm.joints)), start.obstacles
            lines = _outlines(obstacles[obstacles[:, 12] >= 0.0])
            points.append(np.clip(lines[np.isfinite(lines[:, 0])], -reach, reach))
        shown, margin = np.vstack(points), MARGIN * arm.reach(start.q)
        low, high = shown.min(axis=0) - margin, shown.max(axis=0) + margin
        self._frame_length = FRAME * float((high - low).max())
        # Nothing is readable in a flat box.
        sides = np.maximum(high - low, 0.6 * (high - low).max())
        low, high = 0.5 * (low + high - sides), 0.5 * (low + high + sides)
        self._view = 0.5 * (low + high), 0.5 * float((high - low).max())
        self._space.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        self._space.set_box_aspect(tuple(sides), zoom=0.95)  # which scales an array in place
        # One distance of ticks for all axes; none near an end, where it would run into those of the next axis.
        distance = np.diff(MaxNLocator(7, steps=[1, 2, 5, 10]).tick_values(0.0, 0.88 * sides.max()))[0]
        first, last = np.ceil((low + 0.06 * sides) / distance), np.floor((high - 0.06 * sides) / distance)
        for axis, a, b in zip((self._space.xaxis, self._space.yaxis, self._space.zaxis), first, last, strict=True):
            axis.set_ticks(distance * np.arange(a, b + 1))
        for curve in self._curves:
            curve.begin(self._scenario.steps * self._scenario.dt)
        self._background = None

    def show(self, scene: Scene, path: FloatArray, time: FloatArray, errors: FloatArray) -> None:
        """Draws a scene; all of the picture if a fixed part has changed.

        Args:
            scene: The scene.
            path: The tool points so far in [m]. Shape (k, 3).
            time: The times so far in [s]. Shape (k,).
            errors: Errors of position in [m] and of orientation in [rad]. Shape (k, 2).
        """
        self._show_arm(scene, thin(path, self._stride))
        if self._solids:
            self._show_solids(scene)
        clearance = f",  clearance {1e3 * scene.clearance:.1f} mm" if math.isfinite(scene.clearance) else ""
        self._heading.set_text(f"{self._title},  t = {time[-1]:.3f} s{clearance}")
        changes = [curve.show(time, errors[:, i], self._stride) for i, curve in enumerate(self._curves)]
        self.paint(anew=any(changes) or self._background is None)

    def paint(self, *, anew: bool) -> None:
        """Brings the figure up to date, all of it or the moving parts."""
        canvas: Any = self.figure.canvas
        if anew:
            canvas.draw()
        else:
            canvas.restore_region(self._background)
            self._draw_moving()
            canvas.blit(self.figure.bbox)
        canvas.flush_events()

    def pixels(self) -> npt.NDArray[np.uint8]:
        """A copy of the picture in memory. Shape (height, width, 3)."""
        canvas: Any = self.figure.canvas
        return np.array(np.asarray(canvas.buffer_rgba())[..., :3])

    def _show_arm(self, scene: Scene, path: FloatArray) -> None:
        joints, links, gap = scene.joints, [np.zeros(3)], np.full(3, np.nan)
        for (begin, end), prismatic in zip(joints, self._prismatic, strict=True):
            links += [begin, gap, end] if prismatic else [end]
        rails = joints[self._prismatic]
        self._links.set_data_3d(np.vstack([*links, path[-1]]).T)
        self._rails.set_data_3d(np.insert(rails, 2, np.nan, axis=1).reshape(-1, 3).T)
        self._revolute.set_data_3d(joints[~self._prismatic, 1].T)
        self._actual.set_data_3d(path.T)
        self._tool.set_data_3d(path[-1:].T)
        self._target.set_data_3d(scene.target[-3:, None])
        if self._has_orientation:
            for line, axis in zip(self._frame, scene.tool[0].T, strict=True):
                line.set_data_3d(np.vstack([path[-1], path[-1] + self._frame_length * axis]).T)

    def _show_solids(self, scene: Scene) -> None:
        """Moves bodies and obstacles, half-spaces as squares, and the line between the closest pair."""
        *obstacles, bodies, pair = self._solids
        centre, edge = self._view
        for line in obstacles:
            line.set_data_3d(_outlines(cut_half_spaces(scene.obstacles, edge, centre)).T)
        bodies.set_data_3d(_outlines(scene.closest.bodies[0]).T)
        pair.set_data_3d(scene.closest.points[0].T)

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

    def _add_solids(self) -> list[Any]:
        """Lines of obstacles, if there are some, of bodies, and between the closest pair."""
        thin: dict[str, Any] = {"lw": 0.7, "alpha": 0.55}
        obstacles = [self._line("obstacles", color=INK, **thin)] if self._scenario.obstacles else []
        bodies = self._line("bodies", color=BLUE, **thin)
        return [*obstacles, bodies, self._line("closest pair", color=INK, lw=1.2, marker=".", ms=4)]

    def _add_curves(self, kinds: list[tuple[str, str, str]]) -> list[_ErrorCurve]:
        bottom, top, gap = 0.115, 0.93, 0.06
        self.figure.text(0.8175, 0.025, "time [s]", size=MEDIUM, ha="center")
        pitch = (top - bottom + gap) / len(kinds)
        boxes = [(0.66, top + gap - i * pitch, 0.315, pitch - gap) for i in range(1, len(kinds) + 1)]
        return [
            _ErrorCurve(self.figure.add_axes(box), *kind, last=kind is kinds[-1])
            for box, kind in zip(boxes, kinds, strict=True)
        ]

    def _add_legend(self) -> None:
        joints = [self._revolute] * (not self._prismatic.all()) + [self._rails] * bool(self._prismatic.any())
        handles: list[Any] = [self._base, *joints, self._tool, self._target, self._nominal, self._actual]
        labels = [handle.get_label() for handle in handles]
        if self._has_orientation:
            handles, labels = [*handles, tuple(self._frame)], [*labels, "tool x, y, z"]
        self.figure.legend(
            [*handles, *self._solids],
            [*labels, *(line.get_label() for line in self._solids)],
            handler_map={tuple: HandlerTuple(ndivide=None, pad=0.3)},
            loc="lower left",
            bbox_to_anchor=(0.01, 0.0),
            ncols=4,
            fontsize=SMALL,
            frameon=False,
            columnspacing=1.5,
            handletextpad=0.6,
        )


class _ErrorCurve:
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

        A point is drawn for each stretch of `step` steps.
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
    return thin(time, step), np.append(peaks, error[-1])


def _outlines(solids: FloatArray) -> FloatArray:
    """The outlines of solids in the base frame in [m], with gaps between them. Shape (k, 3)."""
    return np.vstack([np.empty((0, 3)), *(in_space(solid, outline(solid[12:])) for solid in solids)])
