"""Pictures of one row's episodes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ikgym.rendering.renderer import Renderer
from ikgym.simulator import Simulator


class Pictures:
    """Records the states of one row, and draws the last one when it is asked for, or at once in a window."""

    def __init__(self, simulator: Simulator, row: int, mode: str) -> None:
        scenario = simulator.scenario
        self._simulator, self._row, self._human = simulator, row, mode == "human"
        around = scenario.surroundings if scenario.collides else None
        oriented = scenario.task.has_orientation
        self.renderer = Renderer(scenario.arm, mode, title=scenario.name, has_orientation=oriented, surroundings=around)

    def begin(self, position_error: float, orientation_error: float) -> None:
        """Records the first state of an episode, with its errors in [m] and [rad]."""
        scenario = self._simulator.scenario
        self.renderer.begin(self._simulator.nominal_positions(self._row), scenario.steps * scenario.dt)
        self.add(position_error, orientation_error)

    def add(self, position_error: float, orientation_error: float) -> None:
        """Records a state, with its errors in [m] and [rad]."""
        simulator, row = self._simulator, self._row
        time, q = int(simulator.steps_made[row]) * simulator.scenario.dt, simulator.true_q[row].copy()
        self.renderer.add(q, position_error, orientation_error, time, simulator.obstacles(row))
        if self._human:
            self.renderer.draw()

    def draw(self) -> npt.NDArray[np.uint8] | None:
        """The last state; see :meth:`ikgym.rendering.Renderer.draw`."""
        return self.renderer.draw()

    def close(self) -> None:
        """Closes the window, if there is one."""
        self.renderer.close()
