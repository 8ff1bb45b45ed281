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

#: Drives with a lag of first order, its time constant in [s], and a delay in steps, where a plant states no drives.
LAG, DELAY = 0.02, 2
#: The fields of a plant that state its drives.
DRIVES = ("bandwidth", "command_delay", "drive")


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


def states_drives(plant: Plant) -> bool:
    """Whether the drives of a plant lag or are late."""
    return plant.longest_command_delay > 0 or np.min(plant.bandwidth) < math.inf or bool(plant.drive)


def describe_drives(plant: Plant) -> str:
    """The drives of :func:`late`."""
    if states_drives(plant):
        return "the drives that the plant states"
    return f"drives with a lag of {1e3 * LAG:g} ms and {DELAY} periods of delay"


def late(plant: Plant) -> Plant:
    """The plant with late drives; as it is where it states drives."""
    if states_drives(plant):
        return plant
    return plant.replace(bandwidth=1.0 / (2.0 * math.pi * LAG), command_delay=DELAY)


def play_late(scenario: Scenario, solver: str) -> Loop:
    """Plays a path in the control loop on late drives, which the loop has to identify on the way.

    Args:
        scenario: A scenario whose path is the same at every reset, with its start. Of its plant the drives count.
        solver: The policy, as text.
    """
    drives = Plant(**{name: getattr(scenario.plant, name) for name in DRIVES})
    scenario = ideal(scenario, plant=late(drives))
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
