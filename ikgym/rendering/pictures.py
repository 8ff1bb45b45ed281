"""Pictures of one row's episodes."""

from __future__ import annotations

from ikgym.rendering.renderer import Renderer
from ikgym.simulator import Simulator


class Pictures(Renderer):
    """Takes the states of one row from the simulator; in a window each is drawn at once."""

    def __init__(self, simulator: Simulator, row: int, mode: str) -> None:
        super().__init__(simulator.scenario, mode)
        self._simulator, self._row = simulator, row

    def record(self, position_error: float, orientation_error: float, *, begins: bool = False) -> None:
        """Records the present state, which may begin an episode, with its errors in [m] and [rad]."""
        simulator, row = self._simulator, self._row
        if begins:
            self.begin(simulator.nominal_positions(row))
        step, q = int(simulator.steps_made[row]), simulator.true_q[row]
        self.add(step, q, position_error, orientation_error, simulator.obstacles(row))
        if self._human:
            self.draw()
