"""Writes clear_motions.json: `python -m tests.scenarios.golden.write_clear_motions [NAME …]` searches motions anew.

A motion is a spline that begins at the start of the scenario. The first one is near the motion of `qp`. Gauss-Newton
steps bring others onto the path and away from everything that is nearer than a distance; random ends give them several
chances.
"""

import json
import sys

import numpy as np
from scipy.spatial.transform import Rotation

import baselines
from ikgym import scenarios
from ikgym.kernels.bodies import OBSTACLE, near_rows
from ikgym.trajectories.batch import paths_of
from tests.scenarios.clear_motions import FILE, clearances, controls, motion, shares

#: Times of the path that are looked at, control points, and the pairs that are looked at at each time.
TIMES, CONTROL, NEAR = 60, 16, 6
#: Weights of an error in [m], of one in [rad], of a distance in [m], of a joint beyond its stop, and of curvature.
POSITION, ORIENTATION, DISTANCE, STOP, CURVATURE = 30.0, 10.0, 30.0, 10.0, 0.1


class Search:
    """A least squares problem over control points.

    Args:
        scenario: The scenario, with a start.
        margin: Distance that is aimed at, in [m].
    """

    def __init__(self, scenario, margin):
        self.scenario, self.margin, arm = scenario, margin, scenario.arm
        self.times = np.linspace(0.0, scenario.trajectory.duration, TIMES)
        frames = scenario.trajectory.frames(self.times, arm)
        self.rotations, self.positions = frames[:, :9].reshape(-1, 3, 3), frames[:, 9:]
        along = [_along(one, self.times, arm) for one in scenario.obstacles]
        self.boxes = np.concatenate([np.empty((TIMES, 0, OBSTACLE)), *along], axis=1)
        self.spread = _at_rest()
        unit = np.repeat(np.eye(CONTROL)[:, :, None], 1, axis=2)
        times = np.tile(self.times, (CONTROL, 1))
        self.basis = paths_of(unit, times, scenario.trajectory.duration)[:, :, 0].T @ self.spread

    def followed(self):
        """Control points near the motion of `qp`, at that margin, with slow prismatic joints."""
        scenario, arm = self.scenario, self.scenario.arm
        slow = arm.replace(velocity_limit=np.where(arm.prismatic, 0.1, 1.0) * arm.velocity_limit)
        played = baselines.track(scenario.replace(arm=slow), f"qp:clearance={self.margin}").q
        at = np.minimum(np.rint(self.times / scenario.dt).astype(int), len(played))
        points = np.linalg.lstsq(self.basis, np.vstack([scenario.start, played])[at], rcond=None)[0]
        points[0] = scenario.start
        return points

    def first(self, end):
        """Control points along the path from the start; their end is moved elsewhere."""
        arm, q = self.scenario.arm, [self.scenario.start_of()]
        for rotation, position in zip(self.rotations[1:], self.positions[1:], strict=True):
            q.append(arm.inverse(rotation, position, start=q[-1], restarts=0)[0])
        points = np.linalg.lstsq(self.basis, np.array(q), rcond=None)[0]
        if end is not None:
            points += np.linspace(0.0, 1.0, len(points))[:, None] * (end - points[-1])
        points[0] = q[0]
        return points

    def minimise(self, points, iterations=40):
        """Levenberg-Marquardt steps; the start stays."""
        damping, n = 1e-2, points.shape[1]
        residual, jacobian = self.residual(points)
        for _ in range(iterations):
            jacobian = jacobian[:, n:]
            hessian = jacobian.T @ jacobian
            step = np.linalg.solve(hessian + damping * np.eye(len(hessian)), -jacobian.T @ residual)
            moved = points.copy()
            moved[1:] += step.reshape(-1, n)
            after, jacobian_after = self.residual(moved)
            if after @ after < residual @ residual:
                done = after @ after > 0.9999 * (residual @ residual)
                points, residual, damping = moved, after, max(0.2 * damping, 1e-6)
                jacobian = jacobian_after
                if done:
                    break
            else:
                jacobian = np.hstack([np.zeros((len(jacobian), n)), jacobian])
                damping *= 5.0
        return points

    def residual(self, points):
        """Residuals and their Jacobian by the control points."""
        arm, q = self.scenario.arm, self.basis @ points
        n, c = q.shape[1], self.basis.shape[1]
        rotations, positions, jacobians = arm.forward_and_jacobian(q)
        turned = Rotation.from_matrix(self.rotations @ rotations.transpose(0, 2, 1)).as_rotvec()
        weights = np.array([POSITION] * 3 + [ORIENTATION] * 3)
        errors = weights * np.hstack([self.positions - positions, turned])
        by_task = -np.einsum("e,ten,tc->tecn", weights, jacobians, self.basis)
        near, by_near = self.near(q)
        low, high = np.maximum(arm.lower, -3.1) + 0.05, np.minimum(arm.upper, 3.1) - 0.05
        low, high = np.minimum(low, q[0]), np.maximum(high, q[0])
        beyond = np.maximum(q - high, 0.0) - np.maximum(low - q, 0.0)
        by_stop = STOP * np.einsum("tn,nm,tc->tncm", beyond != 0.0, np.eye(n), self.basis)
        bent = CURVATURE * np.diff(np.eye(c), 2, axis=0)
        parts = errors.ravel(), near, STOP * beyond.ravel(), (bent @ points).ravel()
        blocks = by_task.reshape(-1, c * n), by_near.reshape(-1, c * n), by_stop.reshape(-1, c * n)
        return np.concatenate(parts), np.vstack([*blocks, np.kron(bent, np.eye(n))])

    def near(self, q):
        """How far pairs are nearer than the margin, and the Jacobian."""
        arm, rows, blocks = self.scenario.arm, [], []
        counts, distances = np.empty(1, dtype=np.int64), np.empty((1, NEAR))
        pairs, gradients = np.empty((1, NEAR, 2), dtype=np.int64), np.empty((1, NEAR, q.shape[1]))
        around = arm.chain, arm.bodies.shapes
        for time, boxes in enumerate(self.boxes):
            found = counts, distances, pairs, gradients
            near_rows(*around, boxes, self.scenario.surroundings.checked, q[time : time + 1], self.margin, *found)
            for i in range(counts[0]):
                rows.append(DISTANCE * (self.margin - distances[0, i]))
                blocks.append(-DISTANCE * np.outer(self.basis[time], gradients[0, i]))
        return np.array(rows), np.array(blocks).reshape(-1, *self.basis.shape[1:], q.shape[1])


def _along(obstacle, times, model):
    rows = obstacle.along(times, model)
    return np.broadcast_to(rows, (TIMES, rows.shape[1]))[:, None]


def _at_rest():
    """All control points from those that are free: three are the same at either end."""
    return np.eye(CONTROL - 4)[np.clip(np.arange(CONTROL) - 2, 0, CONTROL - 5)]


def search(scenario, margin=0.03, tries=20):
    """The clearest of some motions, and its clearance in [m]."""
    problem, rng, arm, best = Search(scenario, margin), np.random.default_rng(0), scenario.arm, (-np.inf, None)
    for number in range(tries):
        start = rng.uniform(np.maximum(arm.lower, -3.0), np.minimum(arm.upper, 3.0)) if number > 1 else None
        ending = None if start is None else arm.inverse(problem.rotations[-1], problem.positions[-1], start=start)[0]
        points = problem.minimise(problem.first(ending)) if number else problem.followed()
        control = problem.spread @ points
        q, converged = motion(scenario, control)
        clear = clearances(scenario, q)[0].min() if converged and max(shares(scenario, q)) < 1.0 else -np.inf
        best = max(best, (clear, control), key=lambda one: one[0])
        if best[0] > 0.9 * margin:
            break
    return best


if __name__ == "__main__":
    found = controls() if FILE.exists() else {}
    for name in sys.argv[1:] or found:
        clear, control = search(scenarios.get(name))
        print(f"{name}: {1e3 * clear:.1f} mm")
        if control is not None:
            found[name] = control
    FILE.write_text(json.dumps({name: np.round(points, 6).tolist() for name, points in sorted(found.items())}) + "\n")
