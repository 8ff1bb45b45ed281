"""Pictures of one row's episodes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ikgym.rendering.renderer import Renderer
from ikgym.simulator import Simulator


class Pictures:
    """Records the states of one row, and draws the last one when it is asked for, or at once in a window.

    Args:
        simulator: The row's simulator.
        row: Its number.
        mode: ``"human"`` or ``"rgb_array"``.
    """

    def __init__(self, simulator: Simulator, row: int, mode: str) -> None:
        scenario = simulator.scenario
        self._simulator, self._row, self._human = simulator, row, mode == "human"
        around = scenario.surroundings if scenario.collides else None
        oriented = scenario.task.has_orientation
        self.renderer = Renderer(scenario.arm, mode, title=scenario.name, has_orientation=oriented, surroundings=around)
        self._boxes = None if around is None else scenario.obstacle_rows(scenario.steps + 1)

    def begin(self, position_error: float, orientation_error: float) -> None:
        """Records the first state of an episode, with its errors in [m] and [rad]."""
        scenario = self._simulator.scenario
        self.renderer.begin(self._simulator.nominal_positions(self._row), scenario.steps * scenario.dt)
        self.add(position_error, orientation_error)

    def add(self, position_error: float, orientation_error: float) -> None:
        """Records a state, with its errors in [m] and [rad]."""
        simulator, row = self._simulator, self._row
        step = int(simulator.steps_made[row])
        boxes = None if self._boxes is None else self._boxes[min(step, len(self._boxes) - 1)]
        time = step * simulator.scenario.dt
        self.renderer.add(simulator.true_q[row].copy(), position_error, orientation_error, time, boxes)
        if self._human:
            self.renderer.draw()

    def draw(self) -> npt.NDArray[np.uint8] | None:
        """The last state; see :meth:`ikgym.rendering.Renderer.draw`."""
        return self.renderer.draw()

    def close(self) -> None:
        """Closes the window, if there is one."""
        self.renderer.close()
