"""Draws episodes, in memory or in a window."""

from __future__ import annotations

import logging
import math
import time as clock
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.registry import backend_registry
from matplotlib.figure import Figure

from ikgym.arms import Arm
from ikgym.kernels.bodies import Surroundings
from ikgym.rendering.scene import Scene
from ikgym.validation import FloatArray

logger = logging.getLogger("ikgym")

WIDTH, HEIGHT, DPI = 960, 480, 100  # [px], even as video codecs need it; [px/in]
INTERVAL = 1.0 / 30.0  # between two pictures in a window, in [s]


class Renderer:
    """Draws the episodes of one environment.

    Args:
        arm: The arm that moves.
        mode: ``"rgb_array"`` draws in memory, without pyplot; ``"human"`` in a window of pyplot, or invisibly in
            memory where the backend has no windows.
        title: Title of the picture.
        has_orientation: Whether there is an orientation error to show.
        width: Of the picture in [px], a multiple of 4; it is half as high, and all in it grows with it.
        surroundings: The obstacles as they are at the start; None if neither they nor bodies are shown.
    """

    def __init__(
        self,
        arm: Arm,
        mode: str,
        *,
        title: str,
        has_orientation: bool,
        width: int = WIDTH,
        surroundings: Surroundings | None = None,
    ) -> None:
        self._arm, self._human, self._dpi = arm, mode == "human", DPI * width / WIDTH
        self._title, self._has_orientation, self._surroundings = title, has_orientation, surroundings
        self._boxes: FloatArray | None = None
        self._scene: Scene | None = None
        self._in_window = False
        self._shown_at = self._shown = -math.inf  # the last picture, in wall time and in the episode's own

    def __getstate__(self) -> dict[str, Any]:
        """All but the figure: a copy keeps the episode and draws on its own figure."""
        return {**self.__dict__, "_scene": None, "_in_window": False, "_staged": False}

    @property
    def figure(self) -> Figure | None:
        """The figure; None before the first picture, and after :meth:`close`."""
        return None if self._scene is None else self._scene.figure

    def begin(self, nominal_positions: FloatArray, duration: float) -> None:
        """Begins an episode and forgets the one before.

        Args:
            nominal_positions: Nominal tool points, one row a step, in [m]. Shape (steps + 1, 3).
            duration: Of the episode, in [s].
        """
        self._duration = duration
        states = len(nominal_positions)
        self._nominal = nominal_positions.copy()
        self._q, self._tool = np.empty((states, self._arm.joints)), np.empty((states, 3))
        self._time, self._errors = np.empty(states), np.empty((states, 2))
        self._states = self._tools = 0  # number of known rows
        self._staged = False  # whether the scene is set for this episode

    def add(
        self,
        q: FloatArray,
        position_error: float,
        orientation_error: float,
        time: float,
        boxes: FloatArray | None = None,
    ) -> None:
        """Records a state without drawing; at most steps + 1 states an episode.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (n,).
            position_error: In [m].
            orientation_error: In [rad]; ignored where the task has no orientation.
            time: Since the start of the episode, in [s].
            boxes: The obstacles as they are now; None for those at the start. Shape (o, 16).
        """
        k, self._boxes = self._states, boxes
        self._q[k] = q
        self._errors[k] = position_error, orientation_error
        self._time[k] = time
        self._states = k + 1

    def draw(self) -> npt.NDArray[np.uint8] | None:
        """Draws the last recorded state, and the path to it.

        In a window the episode plays at most in real time, with about thirty pictures a second; states between them
        are skipped, except the first and the last one.

        Returns:
            The picture in mode ``"rgb_array"``, fresh, of shape (width / 2, width, 3); None in mode ``"human"``.
        """
        if self._human and not self._due():
            return None
        if self._scene is None:
            figure = self._window() if self._human else _in_memory(self._dpi)
            self._scene = Scene(figure, self._arm, self._title, self._has_orientation, self._surroundings)
            self._staged = False
        scene, k = self._scene, self._states
        new = min(self._tools, k - 1)
        rotations, self._tool[new:k] = self._arm.forward(self._q[new:k])
        self._tools = k
        if anew := not self._staged:
            start = np.vstack([self._arm.joint_points(self._q[0]).reshape(-1, 3), self._tool[:1]])
            margin = 0.08 * self._arm.reach(self._q[0])
            scene.set_stage(self._nominal, start, margin, self._duration, self._boxes)
            self._staged = True
        scene.set_arm(self._arm.joint_points(self._q[k - 1]), rotations[-1], self._tool[:k], self._nominal)
        scene.set_solids(self._q[k - 1], self._boxes)
        anew |= scene.set_errors(self._time[:k], self._errors[:k], len(self._time) - 1)
        scene.paint(anew=anew)
        if self._human:
            self._shown_at, self._shown = clock.perf_counter(), self._time[k - 1]
            return None
        return scene.pixels()

    def close(self) -> None:
        """Closes the window, if there is one; closing twice is allowed."""
        if self._in_window:
            import matplotlib.pyplot as plt

            plt.close(self.figure)
        self._scene, self._in_window = None, False

    def _due(self) -> bool:
        """Whether it is time for a picture; in a window, waits for it where the episode runs ahead."""
        if self._in_window:
            import matplotlib.pyplot as plt

            if not plt.fignum_exists(self.figure.number):  # type: ignore[union-attr]  # a window has a figure
                return False  # closed by the user
            if self._time[self._states - 1] - self._shown >= INTERVAL:
                clock.sleep(max(0.0, self._shown_at + INTERVAL - clock.perf_counter()))
                return True
        return self._states in (1, len(self._time)) or clock.perf_counter() - self._shown_at >= INTERVAL

    def _window(self) -> Figure:
        # pyplot may need a window system, which pixels do not.
        import matplotlib.pyplot as plt

        backend, registry = plt.get_backend(), backend_registry
        _, framework = registry.resolve_backend(backend)  # type: ignore[no-untyped-call]
        if framework is None:
            logger.info("render_mode 'human' shows nothing: matplotlib's backend %r has no windows.", backend)
            return _in_memory(self._dpi)
        figure = plt.figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=self._dpi)
        figure.show()
        self._in_window = True
        return figure


def _in_memory(dpi: float) -> Figure:
    figure = Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=dpi)
    FigureCanvasAgg(figure)
    return figure
