"""Writes clear_motions.json: `python -m tests.scenarios.golden.write_clear_motions [NAME …]` plans motions anew.

A motion is the spline that is nearest to a joint path that :class:`baselines.paths.routes.Routes` finds, projected onto
the path of the tool. It begins at the start of the scenario.
"""

import json
import sys

import numpy as np

from baselines.paths.routes import Routes
from ikgym import scenarios
from ikgym.trajectories.batch import paths_of
from tests.scenarios.clear_motions import FILE, clearances, controls, motion, shares

#: Control points, the time between two knots of the plan in [s], and distances that are aimed at, in [m].
CONTROL, SPACING, MARGINS = 16, 0.2, (0.05, 0.04, 0.03, 0.025, 0.02)


def search(scenario):
    """The clearest of some motions, and its clearance in [m]."""
    stride, best = round(SPACING / scenario.dt), (-np.inf, None)
    knots = np.minimum(np.arange(0, scenario.steps + stride, stride), scenario.steps)
    for margin in MARGINS:
        routes = Routes(scenario, scenario.dt * knots, 0.5 * SPACING * scenario.largest_qdot, margin)
        found = routes.route(scenario.start_of())
        if len(found) == len(knots):
            control = fitted(scenario, between(scenario, knots, found))
            q, converged = motion(scenario, control)
            clear = clearances(scenario, q)[0].min() if converged and max(shares(scenario, q)) < 1.0 else -np.inf
            best = max(best, (clear, control), key=lambda one: one[0])
    return best


def between(scenario, knots, q):
    """A joint path at every step from that at knots, which goes through the poses exactly."""
    steps = np.arange(scenario.steps + 1)
    even = np.column_stack([np.interp(steps, knots, joint) for joint in q.T])
    frames = scenario.frames(scenario.trajectory, len(steps))
    rotations = frames[:, :9].reshape(-1, 3, 3) if scenario.task.has_orientation else None
    exact, met = scenario.arm.inverse(rotations, frames[:, -3:], start=even, restarts=0)
    return np.where(met[:, None], exact, even)


def fitted(scenario, q):
    """The control points of the spline that is nearest to a joint path; three are the same at either end."""
    spread = np.eye(CONTROL - 4)[np.clip(np.arange(CONTROL) - 2, 0, CONTROL - 5)]
    times = np.tile(scenario.times(len(q)), (CONTROL, 1))
    basis = paths_of(np.eye(CONTROL)[:, :, None], times, scenario.trajectory.duration)[:, :, 0].T @ spread
    points = np.linalg.lstsq(basis, q, rcond=None)[0]
    points[0] = q[0]
    return spread @ points


if __name__ == "__main__":
    found = controls() if FILE.exists() else {}
    for name in sys.argv[1:] or found:
        clear, control = search(scenarios.get(name))
        print(f"{name}: {1e3 * clear:.1f} mm")
        if control is not None:
            found[name] = control
    FILE.write_text(json.dumps({name: np.round(points, 6).tolist() for name, points in sorted(found.items())}) + "\n")
