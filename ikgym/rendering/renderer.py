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

from ikgym.rendering.picture import Picture
from ikgym.rendering.scene import Scene
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

logger = logging.getLogger("ikgym")

WIDTH, HEIGHT, DPI = 960, 480, 100  # [px], even as video codecs need it; [px/in]
INTERVAL = 1.0 / 30.0  # between two pictures in a window, in [s]


class Renderer:
    """Draws episodes of one arm.

    Args:
        scenario: Their scenario.
        mode: ``"rgb_array"`` draws in memory, without pyplot; ``"human"`` in a window of pyplot, or invisibly in
            memory where the backend has no windows.
        title: Title of the picture, by default the name of the scenario.
        width: Of the picture in [px], a multiple of 4; it is half as high, and all in it grows with it.
    """

    def __init__(self, scenario: Scenario, mode: str, *, title: str | None = None, width: int = WIDTH) -> None:
        self._scenario, self._human, self._dpi = scenario, mode == "human", DPI * width / WIDTH
        self._title = scenario.name if title is None else title
        self._picture: Picture | None = None
        self._in_window = False
        self._shown_at = self._shown = -math.inf  # the last picture, in wall time and in that of the episode

    def __getstate__(self) -> dict[str, Any]:
        """Everything except the figure: a copy keeps the episode and draws on a new figure."""
        return {**self.__dict__, "_picture": None, "_in_window": False, "_begun": False}

    @property
    def figure(self) -> Figure | None:
        """The figure; None before the first picture, and after :meth:`close`."""
        return None if self._picture is None else self._picture.figure

    def begin(self, nominal: FloatArray) -> None:
        """Begins an episode with its nominal tool points in [m], one a step, and forgets the one before."""
        self._nominal, states = nominal.copy(), len(nominal)
        self._path, self._time, self._errors = np.empty((states, 3)), np.empty(states), np.empty((states, 2))
        self._states, self._begun = 0, False  # whether the picture shows this episode

    def add(
        self, step: int, q: FloatArray, position_error: float, orientation_error: float, boxes: FloatArray | None = None
    ) -> None:
        """Records a state, which is drawn in a window; at most steps + 1 states an episode.

        Args:
            step: Steps made in the episode.
            q: Joint coordinates in [rad] or [m]. Shape (n,).
            position_error: In [m].
            orientation_error: In [rad]; ignored where the task has no orientation.
            boxes: The obstacles as they are now; None for those at the start. Shape (o, 16).
        """
        k, boxes = self._states, self._scenario.surroundings.boxes if boxes is None else boxes
        self._scene = Scene(self._scenario, q.copy(), self._nominal[step], boxes.copy())
        if k == 0:
            self._start = self._scene
        self._path[k], self._time[k] = self._scene.tool[1], step * self._scenario.dt
        self._errors[k], self._states = (position_error, orientation_error), k + 1
        if self._human:
            self.draw()

    def draw(self) -> npt.NDArray[np.uint8] | None:
        """Draws the last recorded state, and the path to it.

        In a window the episode plays at most in real time, with about thirty pictures a second; states between them
        are skipped, except the first and the last one.

        Returns:
            The picture in mode ``"rgb_array"``, fresh, of shape (width / 2, width, 3); None in mode ``"human"``.
        """
        if self._human and not self._due():
            return None
        if self._picture is None:
            figure = self._window() if self._human else _in_memory(self._dpi)
            self._picture, self._begun = Picture(figure, self._scenario, self._title), False
        if not self._begun:
            self._picture.begin(self._start, self._nominal)
            self._begun = True
        k = self._states
        self._picture.show(self._scene, self._path[:k], self._time[:k], self._errors[:k])
        if self._human:
            self._shown_at, self._shown = clock.perf_counter(), self._time[k - 1]
            return None
        return self._picture.pixels()

    def close(self) -> None:
        """Closes the window, if there is one; closing twice is allowed."""
        if self._in_window:
            import matplotlib.pyplot as plt

            plt.close(self.figure)
        self._picture, self._in_window = None, False

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
