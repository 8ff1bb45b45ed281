"""A motion in the control loop, on drives that lag."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from gymnasium.utils import seeding

from baselines.controller import Controller, StopReason
from baselines.paths.motion import ideal
from ikgym.plant import Plant
from ikgym.scenarios import Scenario
from ikgym.simulator import Simulator

#: Drives with a lag of first order, its time constant in [s], and a delay in steps.
LAG, DELAY = 0.02, 2


class Loop(NamedTuple):
    """How a motion went in the control loop.

    Attributes:
        error: The largest distance of the tool from the reference, in [m].
        stopped: Why the arm was stopped; None if it was not.
        time: When the motion ended, in [s].
    """

    error: float
    stopped: StopReason | None
    time: float


def late(plant: Plant) -> Plant:
    """The plant with late drives."""
    return plant.replace(bandwidth=1.0 / (2.0 * math.pi * LAG), command_delay=DELAY)


def play_late(scenario: Scenario, solver: str) -> Loop:
    """Plays a path in the control loop on late drives, which the loop has to identify on the way.

    Args:
        scenario: A scenario whose path is the same at every reset, with its start. Its plant is taken to be ideal.
        solver: The policy, as text.
    """
    scenario = ideal(scenario, plant=late(Plant()))
    controller = Controller(scenario, solver)
    simulator = Simulator(scenario, None, controller.ahead)
    simulator.reset(np.ones(1, dtype=np.bool_), [seeding.np_random(0)[0]])
    out, errors = simulator.observe(), [0.0]
    for _ in range(scenario.steps):
        obstacles = out.obstacles[0] if out.obstacles.size else None
        qdot = controller.step(out.q[0], None, out.nominal[0], obstacles=obstacles)
        if controller.stopped is not None:
            break
        out = simulator.step(qdot / scenario.velocity_limit)
        errors.append(float(out.position_error[0]))
    return Loop(max(errors), controller.stopped, scenario.dt * (len(errors) - 1))
