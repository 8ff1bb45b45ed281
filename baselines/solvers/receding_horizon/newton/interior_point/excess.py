"""Kernels: by how much a joint path leaves its limits, and what it costs within them."""

from __future__ import annotations

import numpy as np

from baselines.solvers.receding_horizon.newton.cost import true_cost
from baselines.solvers.receding_horizon.newton.interior_point.merit import change_steps
from ikgym.kernels.jit import uncounted


@uncounted
def excess(problem, path, before):
    """By how much a path leaves its limits, at most: a share of them, and of positions in units of the largest step.

    Braking behind the last knot is not looked at.

    Args:
        problem: A :class:`newton.workspace.PathProblem` of K knots.
        path: Joint coordinates at the knots in [rad] or [m]. Shape (K, n).
        before: Scratch. Shape (n,).

    Returns:
        The largest excess, not above 0 where all limits are kept.
    """
    data, lengths, start = problem.data, problem.grid.length, problem.start
    limits, lower, upper, changes = data.velocity_limit, data.lower, data.upper, problem.change_limit
    limited, dt, most = changes.shape[0] > 0, data.dt, -np.inf
    for k in range(path.shape[0]):
        rate, span = 1.0 / (lengths[k] * dt), change_steps(lengths, k)
        for j in range(path.shape[1]):
            velocity = (path[k, j] - (path[k - 1, j] if k > 0 else start[j])) * rate
            beyond = max(path[k, j] - upper[j], lower[j] - path[k, j]) / (dt * limits[j])
            most = max(most, abs(velocity) / limits[j] - 1.0, beyond)
            if limited:
                change = velocity - (before[j] if k > 0 else problem.qdot_before[j])
                most = max(most, abs(change) / (span * changes[j]) - 1.0)
            before[j] = velocity
    return most


@uncounted
def cost_within(problem, path, slack, workspace):
    """What a path costs; infinitely much where it leaves limits and accelerations are among them.

    Args:
        problem: A :class:`newton.workspace.PathProblem` of K knots.
        path: Joint coordinates at the knots in [rad] or [m]. Shape (K, n).
        slack: By which share limits may be left.
        workspace: A :class:`newton.workspace.NewtonWorkspace`.
    """
    if problem.change_limit.shape[0] > 0 and excess(problem, path, workspace.before) > slack:
        return np.inf
    return true_cost(problem, path, workspace)
