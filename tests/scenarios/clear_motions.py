"""Joint motions that follow the path of a scenario and touch nothing, from control points of splines."""

import json
import pathlib

import numpy as np

from ikgym.kernels.bodies import clearance_rows
from ikgym.plant.sweep import drift, sweep
from ikgym.trajectories import JointSpline

FILE = pathlib.Path(__file__).parent / "golden" / "clear_motions.json"


def controls():
    """Control points by the names of scenarios, in [rad] or [m]."""
    return {name: np.array(points) for name, points in json.loads(FILE.read_text()).items()}


def motion(scenario, control):
    """The joint coordinates on the path that are nearest to a spline, at all steps, and whether they converged."""
    frames = scenario.frames(scenario.trajectory, scenario.steps + 1)
    near = JointSpline(control, scenario.trajectory.duration).joint_path(scenario.times(scenario.steps + 1))
    near = np.clip(near, scenario.arm.lower, scenario.arm.upper)
    q, converged = scenario.arm.inverse(frames[:, :9].reshape(-1, 3, 3), frames[:, 9:], start=near, restarts=0)
    return q, bool(converged.all())


def clearances(scenario, q):
    """The smallest signed distance after each step, in [m], and the pairs."""
    rows, checked = scenario.obstacle_rows(len(q)), scenario.surroundings.checked
    distances, pairs = np.empty(len(q)), np.empty((len(q), 2), dtype=np.int64)
    for step in range(len(q) if len(rows) > 1 else 1):
        at = slice(step, step + 1) if len(rows) > 1 else slice(None)
        boxes = np.ascontiguousarray(rows[step])
        shapes = scenario.arm.bodies.shapes
        clearance_rows(scenario.arm.chain, shapes, boxes, checked, q[at], distances[at], pairs[at])
    return distances, pairs


def between(scenario, q, distances):
    """Distances that are kept between the steps, where joints and obstacles move evenly, in [m]."""
    moved = (np.abs(np.diff(q, axis=0)) @ sweep(scenario.arm, np.abs(q).max(axis=0), 0.0).T).max(axis=1)
    rows = scenario.obstacle_rows(len(q))
    moved += drift(rows, scenario.arm.reach(np.abs(q).max(axis=0)))[:-1] if len(rows) > 1 else 0.0
    return 0.5 * (distances[:-1] + distances[1:] - moved)


def shares(scenario, q):
    """The largest shares of the limits of velocity and acceleration that a motion takes, from rest."""
    qdot = np.diff(q, axis=0) / scenario.dt
    qddot = np.diff(qdot, axis=0, prepend=np.zeros((1, q.shape[1]))) / scenario.dt
    return np.abs(qdot / scenario.largest_qdot).max(), np.abs(qddot / scenario.arm.acceleration_limit).max()
