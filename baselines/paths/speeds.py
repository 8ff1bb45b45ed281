"""How fast the tool moves and turns along a path."""

from __future__ import annotations

import itertools

import numpy as np

from baselines.paths.motion import path_duration
from ikgym.kernels.rotations import geodesic_angle
from ikgym.scenarios import Scenario
from ikgym.trajectories import PathTrajectory, Trajectory

#: Points of a path at which speeds are taken.
POINTS = 4001


def fastest(scenario: Scenario) -> tuple[float, float]:
    """Largest speeds of the tool along the whole path in [m/s] and [rad/s]; 0 where there is no orientation."""
    times = np.linspace(0.0, path_duration(scenario), POINTS)
    frames = scenario.trajectory.frames(times, scenario.arm)
    linear = np.linalg.norm(np.diff(frames[:, -3:], axis=0), axis=1)
    angular = np.zeros(1)
    if scenario.task.has_orientation:
        rotations = frames[:, :9].reshape(-1, 3, 3)
        angular = np.array([geodesic_angle(a, b) for a, b in itertools.pairwise(rotations)])
    return float(linear.max() / times[1]), float(angular.max() / times[1])


def speed_limit(trajectory: Trajectory) -> tuple[float, str] | None:
    """The speed in [m/s] that a time law states and does not come to, and the reason; None where there is none."""
    if not isinstance(trajectory, PathTrajectory) or trajectory.time_law.duration is not None:
        return None
    law, path = trajectory.time_law, trajectory.path
    bend = law.acceleration / np.sqrt(2.0)
    if path.curvature * law.speed**2 > bend:
        return law.speed, f"its bends of {1.0 / path.curvature:.3g} m allow no more with {law.acceleration:g} m/s²"
    if law.shortest(path.length, law.speed, law.acceleration) > law.shortest(path.length, law.speed, np.inf):
        return law.speed, f"it is too short for more with {law.acceleration:g} m/s²"
    return None
