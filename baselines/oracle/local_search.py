"""Kernels: joint paths from random starts, their improvement, and their iterated local search.

All take a :class:`baselines.solvers.receding_horizon.newton.workspace.PathProblem` of K knots, and paths (S, K, n), of
which they work on those from ``first`` up to ``last``. A path's result depends on nothing but its number, so that
threads may share them out as they like.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.solvers.receding_horizon.newton.guess import DAMPING, STREAM, draw, initial_guess, uniform
from baselines.solvers.receding_horizon.newton.interior_point import LEFT, cost_within, minimise_path
from baselines.solvers.receding_horizon.newton.minimise import NewtonSettings
from baselines.solvers.receding_horizon.newton.workspace import knot_workspace, newton_workspace
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import expanded, inner, kernel

# Newton steps of a branch, and the relative precision that ends them before.
STEPS, PRECISION = 50, 1e-4
# By which share a path may leave limits, where accelerations are limited.
SLACK = 10.0 * LEFT
# A branch that gains less than this share is the same path.
GAIN = 1e-4
# Probability that a branch is blended with another path, and that it returns to the first.
BLENDED, BACK = 0.6, 0.2
# Knots over which two paths are blended, as a share of all, at most.
BLEND = 0.3


class Improved(NamedTuple):
    """Results of S paths.

    Attributes:
        costs: Their costs. Shape (S,).
        gradients: Norms of the gradient by q, in [1/rad] or [1/m]. Shape (S,).
    """

    costs: npt.NDArray[np.float64]
    gradients: npt.NDArray[np.float64]


@kernel
def random_paths(problem, seed, paths, first, last):
    """Sets paths (S, K, n) that drift at random in the null space of the task; path 0 does not drift."""
    n = problem.start.shape[0]
    workspace = knot_workspace(problem.data.kind, problem.nominal.shape[1], n)
    drift = np.empty(n)
    for s in range(first, last):
        drift[:] = 0.0
        damping = DAMPING if s == 0 else draw(seed, s, drift)
        initial_guess(problem, 0, drift, damping, paths[s], workspace)


@kernel
def improve(problem, settings, paths, improved, first, last):
    """Improves each path (S, K, n) by Newton's method, in place; none gets worse.

    The settings are :class:`NewtonSettings`; :class:`Improved` receives the results.
    """
    knots, n = paths.shape[1:]
    costs = improved.costs
    workspace, multipliers = _newton(problem, knots, n)
    before = np.empty((knots, n))
    for s in range(first, last):
        path = paths[s]
        before[:] = path
        worst = cost_within(problem, path, SLACK, workspace)
        multipliers[:] = 0.0
        improved.gradients[s] = minimise_path(problem, path, multipliers, settings, 0.0, workspace).gradient_norm
        costs[s] = cost_within(problem, path, SLACK, workspace)
        if not costs[s] <= worst:
            path[:] = before
            costs[s] = worst


@kernel
def iterated_local_search(problem, seed, rounds, partners, paths, costs, first, last):
    """Branches off each path again and again, and keeps the cheaper one.

    A branch is a random change of the path, see :func:`branch_off`, that Newton's method makes a path of low cost.

    Args:
        problem: See the module.
        seed: Of the random numbers.
        rounds: Branches of each path.
        partners: Paths to blend with. Shape (P, K, n).
        paths: Changed in place. Shape (S, K, n).
        costs: Of the paths, changed in place. Shape (S,).
        first: See the module.
        last: See the module.
    """
    knots, n = paths.shape[1:]
    workspace, multipliers = _newton(problem, knots, n)
    branch, drift = np.empty((knots, n)), np.empty(n)
    settings = NewtonSettings(False, STEPS, PRECISION)
    for s in range(first, last):
        path = paths[s]
        for r in range(rounds):
            branch_off(problem, (seed + s, r), path, partners, drift, branch, workspace.knot)
            multipliers[:] = 0.0
            minimise_path(problem, branch, multipliers, settings, 0.0, workspace)
            cost = cost_within(problem, branch, SLACK, workspace)
            if cost < (1.0 - GAIN) * costs[s]:
                path[:] = branch
                costs[s] = cost


@kernel
def branch_off(problem, draws, path, partners, drift, branch, workspace):
    """A random change of a path.

    The branch leaves the path at a random knot, drifts in the null space, and continues freely to the end or comes
    back; or it goes over to a partner (P, K, n), or comes from there. ``draws`` are the key of the random numbers and
    the number of the branch; ``drift`` is scratch.
    """
    key, r = draws
    knots = path.shape[0]
    damping = draw(key, 2 * r, drift)
    stream = STREAM * (2 * r + 1)
    kind, share = uniform(key, stream + 1), uniform(key, stream + 2)
    off = int(share * knots)
    if kind < BLENDED:
        other = partners[int(uniform(key, stream + 3) * partners.shape[0])]
        width = max(BLEND * knots * uniform(key, stream + 4) ** 2, 1.0)
        if uniform(key, stream + 5) < 0.5:
            _blend(path, other, off, width, branch)
        else:
            _blend(other, path, off, width, branch)
    else:
        branch[:off] = path[:off]
        initial_guess(problem, off, drift, damping, branch, workspace)
        if kind < BLENDED + BACK:
            # as far as it went off, so long it takes to come back
            length = max(uniform(key, stream + 3) * (knots - off), 1.0)
            _blend(branch, path, off + 1.5 * length, length, branch)


@inner
def _blend(a, b, middle, width, out):
    """Goes over from path ``a`` to path ``b`` around the knot ``middle``; ``out`` may be one of them."""
    for k in range(out.shape[0]):
        share = min(max((k - middle) / width + 0.5, 0.0), 1.0)
        for j in range(out.shape[1]):
            out[k, j] = (1.0 - share) * a[k, j] + share * b[k, j]


@expanded
def _newton(problem, knots, n):
    """Workspace and multipliers of Newton's method."""
    kind, m = problem.data.kind, problem.nominal.shape[1]
    limited = problem.change_limit.shape[0] > 0
    workspace = newton_workspace(kind, m, knots, n, limited, problem.clearance)
    return workspace, np.empty((knots, task_kernels.error_size(kind, m) + 2 * n))
