"""The table `retimed`: paths that are too fast, in the time that they need."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from baselines.paths import retime
from baselines.paths.motion import ideal, path_duration, play_from
from baselines.paths.survey import follows
from baselines.paths.timing import Timing
from docs.keeping import Line
from ikgym import scenarios
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Paths of the catalogue, and how many times faster they are made.
PATHS = (("panda-fast", 1), ("iiwa14-fast", 1), ("tiago-fast", 1), ("panda-square", 8), ("panda-lemniscate", 8))
#: The precision of the bisection, and the largest factor.
PRECISION, LARGEST = 1.01, 30.0


def faster(name: str, times: int) -> Scenario:
    """A path of the catalogue at a multiple of its speed."""
    scenario = scenarios.get(name)
    trajectory: Any = scenario.trajectory
    law = trajectory.time_law
    law = dataclasses.replace(law, speed=times * law.speed, acceleration=times**2 * law.acceleration)
    return scenario.replace(trajectory=trajectory.replace(time_law=law))


def by_one_factor(scenario: Scenario, start: FloatArray) -> float:
    """The shortest time in which `qp` follows from a start, where all of the path is slowed alike, in [s]."""
    low, high = 1.0, 1.5
    while not _follows(scenario, start, high):
        low, high = high, 1.5 * high
        if high > LARGEST:
            return math.inf
    while high > PRECISION * low:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if _follows(scenario, start, middle) else (middle, high)
    return high * path_duration(scenario)


def _follows(scenario: Scenario, start: FloatArray, factor: float) -> bool:
    trajectory = Timing.uniform(path_duration(scenario), factor).of(scenario.trajectory)
    return follows(play_from(ideal(scenario, trajectory=trajectory, start=start), start[None]))


def measure() -> list[Line]:
    """The table, one line a path."""
    return [_line(name, times) for name, times in PATHS]


def _line(name: str, times: int) -> Line:
    scenario = faster(name, times)
    found = retime(scenario)
    slowed = min(by_one_factor(scenario, start) for start in (scenario.start_of(), found.motion.q[0, 0]))
    label = name if times == 1 else f"{name}, {times} times as fast"
    error = 1e3 * float(found.motion.position_error.max())
    return {
        "path": label,
        "asked_s": found.asked,
        "one_factor_s": slowed,
        "retimed_s": found.duration,
        "error_mm": error,
    }
