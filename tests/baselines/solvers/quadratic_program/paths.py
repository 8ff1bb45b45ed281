"""Paths of arms with limits, short ones."""

import functools

import numpy as np
from scipy.optimize import linprog

import baselines
import ikgym
from baselines.episodes import rollout
from ikgym.trajectories import PathTrajectory
from ikgym.trajectories.orientations import FixedOrientation
from ikgym.trajectories.paths.polyline import Line
from ikgym.trajectories.paths.round import Circle
from ikgym.trajectories.time_laws import Quintic


@functools.cache
def circle(arm="panda", dt=1e-3, radius=0.05, speed=0.25, acceleration=1.0, wait=0.0, **changes):
    """A circle around the tool's home, as fast as the time law allows, and some time at rest behind it."""
    arm = ikgym.arms.get(arm)
    position = arm.forward(arm.home)[1]
    path = Circle(position - [radius, 0, 0], radius)
    return _scenario(arm, path, Quintic(speed, acceleration), dt, wait, **changes)


@functools.cache
def beyond_reach(dt=1e-3):
    """A line that leads the Panda out of its reach."""
    arm = ikgym.arms.get("panda")
    position = arm.forward(arm.home)[1]
    return _scenario(arm, Line(position, position + np.array([0.5, 0, 0.1])), Quintic(0.5, 2.0), dt, 0.2)


def _scenario(arm, path, law, dt, wait, **changes):
    trajectory = PathTrajectory(path, law, FixedOrientation(arm.forward(arm.home)[0]))
    steps = int(np.ceil((trajectory.duration + wait) / dt))
    given = {
        "task": ikgym.tasks.get("pose"),
        "dt": dt,
        "steps": steps,
        "start": arm.home,
        "jerk_limit": np.inf,
        **changes,
    }
    return ikgym.Scenario("path", arm, trajectory=trajectory, **given)


def most_possible(jacobian, shift, lower, upper):
    """The largest s from 0 to 1 for which bounds allow s Δx, by a linear program; 0 where they allow nothing."""
    n, scale = jacobian.shape[1], np.linalg.norm(shift)
    columns, bounds = np.hstack([jacobian, -shift[:, None]]) / scale, [*zip(lower, upper, strict=True), (0.0, 1.0)]
    found = linprog(-np.eye(n + 1)[n], A_eq=columns, b_eq=np.zeros(len(shift)), bounds=bounds)
    return found.x[n] if found.success else 0.0


def played(scenario, name="qp", **parameters):
    """The record of an episode of a policy."""
    return rollout(scenario, baselines.make(name, scenario, **parameters), 0)
