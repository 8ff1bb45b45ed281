"""Waypoints of the path-following problems that others published, see :mod:`ikgym.problems`."""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt

from ikgym import scenarios

#: From waypoint to waypoint in [s], and in control steps.
PERIOD, STEPS = 0.2, 10
#: Name of the scenario with RL-ITG's random paths, and the beginning of their own names.
RANDOM = "rlitg-random"
#: Random postures from which CppFlow's starts were searched.
POSTURES = 100


def waypoint_steps(waypoints: int) -> range:
    """The control steps at which the waypoints are reached; the first one is the start."""
    return range(0, STEPS * (waypoints - 1) + 1, STEPS)


@functools.cache
def unreached(problem: str, restarts: int = 300) -> npt.NDArray[np.int64]:
    """Waypoints at which no joint coordinates within the limits were found, counted from 0.

    Args:
        problem: Name of the problem.
        restarts: Random postures from which each waypoint is searched.
    """
    scenario = scenarios.get(problem)
    frames = scenario.frames(scenario.trajectory, scenario.steps + 1)[::STEPS]
    rotations, positions = frames[:, :9].reshape(-1, 3, 3), frames[:, 9:]
    return np.flatnonzero(~scenario.arm.inverse(rotations, positions, restarts=restarts)[1])
