"""Kernels: initial guesses of a joint path, by damped least squares from knot to knot, and their random numbers."""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inlined, inner, kernel, uncounted
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.kernels.limits import FASTEST, LOWER, UPPER
from ikgym.kernels.linear_algebra import damped_step, dot

# Damped steps that bring the arm from one knot to the next.
CORRECTIONS = 2
# λ of a guess without drift, and the range of λ of random ones; the range of drifts in [rad/s] or [m/s].
DAMPING = 1e-3
DAMPINGS = (0.03, 1.0)
DRIFTS = (1.0, 10.0)
# Random numbers that belong to one guess.
STREAM = 256


@inner
def initial_guess(problem, first, drift, damping, path, workspace):
    """Goes from knot to knot by damped least squares, drifting in the null space of the task.

    Args:
        problem: A :class:`workspace.PathProblem` of K knots.
        first: The first knot to be set; those before stay as they are.
        drift: Joint velocities of which the part that does not move the task is added, in [rad/s] or [m/s].
            Shape (n,).
        damping: λ of the damped least squares.
        path: Receives the joint coordinates at the knots in [rad] or [m]. Shape (K, n).
        workspace: A :class:`workspace.KnotWorkspace`.
    """
    data, start, nominal, grid = problem.data, problem.start, problem.nominal, problem.grid
    rotation, position = workspace.rotation, workspace.position
    jacobian, error = workspace.jacobian, workspace.error
    n, e = path.shape[1], error.shape[0]
    move = np.empty(n)
    for k in range(first, path.shape[0]):
        here = path[k]
        for j in range(n):
            here[j] = path[k - 1, j] if k > 0 else start[j]
        for correction in range(CORRECTIONS):
            forward_and_jacobian(data.chain, here, rotation, position, workspace.geometric)
            task_kernels.coordinates(data.kind, rotation, position, workspace.pose)
            task_kernels.error(data.kind, nominal[grid.at[k] - 1], workspace.pose, error)
            task_kernels.jacobian(data.kind, rotation, workspace.geometric, jacobian)
            if correction == 0:
                # The effect of the drift on the task is subtracted from the error, and so from the step.
                span = grid.length[k] * data.dt
                for i in range(e):
                    error[i] -= span * dot(jacobian[i], drift)
            if not damped_step(jacobian, error, damping, workspace.gram, workspace.solution, move):
                break
            for j in range(n):
                moved = here[j] + move[j] + (span * drift[j] if correction == 0 else 0.0)
                here[j] = min(max(moved, data.limits[LOWER, j]), data.limits[UPPER, j])


@uncounted
def slow_down(problem, path):
    """Makes a path follow itself within the velocity limits, and so later where it was too fast; in place."""
    data, start, length = problem.data, problem.start, problem.grid.length
    for k in range(path.shape[0]):
        for j in range(path.shape[1]):
            before = path[k - 1, j] if k > 0 else start[j]
            most = data.limits[FASTEST, j] * data.dt * length[k]
            path[k, j] = min(max(path[k, j], before - most), before + most)


@inlined
def uniform(key, counter):
    """A number between 0 and 1 for a key and a counter (SplitMix64); no state, so that rows stay independent."""
    z = np.uint64(key) * np.uint64(0xD1342543DE82EF95) + (np.uint64(counter) + np.uint64(1)) * np.uint64(
        0x9E3779B97F4A7C15
    )
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return np.float64(z >> np.uint64(11)) * 2.0**-53


@kernel
def draw(seed, counter, drift):
    """Draws the ``counter``-th random guess of a seed.

    Args:
        seed: A whole number of at least 0.
        counter: Which guess.
        drift: Receives its drift, in [rad/s] or [m/s]. Shape (n,).

    Returns:
        Its damping λ.
    """
    n = drift.shape[0]
    square = 0.0
    for j in range(n):
        # A sum of four is near enough to normal, so that no direction is preferred.
        total = -2.0
        for i in range(4):
            total += uniform(seed, STREAM * counter + 3 + 4 * j + i)
        drift[j] = total
        square += total * total
    size = _between(DRIFTS, uniform(seed, STREAM * counter + 1)) / math.sqrt(square)
    for j in range(n):
        drift[j] *= size
    return _between(DAMPINGS, uniform(seed, STREAM * counter + 2))


@inlined
def _between(bounds, share):
    return bounds[0] * (bounds[1] / bounds[0]) ** share
