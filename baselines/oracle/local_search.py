"""Kernels: joint paths from random starts, their improvement, and their local search branch by branch.

All take the :class:`cost.Rules`, a :class:`grid.Grid` of K knots, the
joint coordinates at the start (n,), the nominal task coordinates after the steps 1, 2, … (steps, m), and paths
(S, K, n), of which they work on those from ``first`` up to ``last``. A path's result depends on nothing but its number,
so that threads may share them out as they like.
"""

from __future__ import annotations

import numpy as np

from baselines.solvers.receding_horizon.newton.cost import true_cost
from baselines.solvers.receding_horizon.newton.guess import DAMPING, STREAM, draw, roll_out, uniform
from baselines.solvers.receding_horizon.newton.minimise import minimise, room_for
from ikgym import task_kernels
from ikgym.jit import kernel

# Newton steps of a branch, and the relative precision that ends them before.
STEPS, PRECISION = 50, 1e-4
# A branch that gains less than this share is the same path.
GAIN = 1e-4
# How often a branch is blended with another path, and how often it comes back to its own; else it goes its own way.
BLENDED, BACK = 0.6, 0.2
# Knots over which two paths are blended, as a share of all, at most.
BLEND = 0.3


@kernel
def roll_outs(rules, grid, start, nominal, seed, paths, first, last):
    """Sets paths that drift at random in the null space of the task; path 0 does not drift."""
    n, e = start.shape[0], _errors(rules, nominal)
    scratch = room_for(rules.kind, nominal.shape[1], 1, n).scratch
    drift, gram, x = np.empty(n), np.empty((e, e)), np.empty(e)
    for s in range(first, last):
        drift[:] = 0.0
        damping = DAMPING if s == 0 else draw(seed, s, drift)
        roll_out(rules, grid, start, nominal, 0, drift, damping, paths[s], scratch, gram, x)


@kernel
def settle(rules, grid, start, nominal, exact, most, tolerance, paths, costs, gradients, made, first, last):
    """Improves each path by Newton's method; none gets worse.

    Args:
        rules: See the module.
        grid: See the module.
        start: See the module.
        nominal: See the module.
        exact: Whether with the Hessian itself.
        most: Newton steps at most.
        tolerance: Relative precision of the cost.
        paths: Changed in place. Shape (S, K, n).
        costs: Receives the costs. Shape (S,).
        gradients: Receives the norms of the gradient by q. Shape (S,).
        made: Receives the Newton steps made. Shape (S,).
        first: See the module.
        last: See the module.
    """
    knots, n = paths.shape[1:]
    room = room_for(rules.kind, nominal.shape[1], knots, n)
    held, before = np.empty((knots, _errors(rules, nominal) + 2 * n)), np.empty((knots, n))
    for s in range(first, last):
        path = paths[s]
        before[:] = path
        worst = true_cost(rules, grid, start, nominal, path, room.scratch)
        held[:] = 0.0
        _, made[s], _, gradients[s] = minimise(rules, grid, start, nominal, path, held, exact, most, tolerance, room)
        costs[s] = true_cost(rules, grid, start, nominal, path, room.scratch)
        if not costs[s] <= worst:
            path[:] = before
            costs[s] = worst


@kernel
def climb(rules, grid, start, nominal, seed, rounds, partners, paths, costs, first, last):
    """Local search: branches off each path again and again, and keeps what is cheaper.

    A branch leaves the path at a random knot, drifts in the null space, and goes its own way to the end or comes
    back; or it goes over to a partner, or comes from there. Newton's method then makes it a path of low cost.

    Args:
        rules: See the module.
        grid: See the module.
        start: See the module.
        nominal: See the module.
        seed: Of the draws.
        rounds: Branches of each path.
        partners: Paths to blend with. Shape (P, K, n).
        paths: Changed in place. Shape (S, K, n).
        costs: Of the paths, changed in place. Shape (S,).
        first: See the module.
        last: See the module.
    """
    knots, n = paths.shape[1:]
    e = _errors(rules, nominal)
    room = room_for(rules.kind, nominal.shape[1], knots, n)
    held, branch = np.empty((knots, e + 2 * n)), np.empty((knots, n))
    drift, gram, x = np.empty(n), np.empty((e, e)), np.empty(e)
    for s in range(first, last):
        path, key = paths[s], seed + s
        for r in range(rounds):
            damping = draw(key, 2 * r, drift)
            own = STREAM * (2 * r + 1)
            kind, share = uniform(key, own + 1), uniform(key, own + 2)
            off = int(share * knots)
            if kind < BLENDED:
                other = partners[int(uniform(key, own + 3) * partners.shape[0])]
                width = max(BLEND * knots * uniform(key, own + 4) ** 2, 1.0)
                if uniform(key, own + 5) < 0.5:
                    _blend(path, other, off, width, branch)
                else:
                    _blend(other, path, off, width, branch)
            else:
                branch[:off] = path[:off]
                roll_out(rules, grid, start, nominal, off, drift, damping, branch, room.scratch, gram, x)
                if kind < BLENDED + BACK:
                    # as far as it went off, so long it takes to come back
                    length = max(uniform(key, own + 3) * (knots - off), 1.0)
                    _blend(branch, path, off + 1.5 * length, length, branch)
            held[:] = 0.0
            minimise(rules, grid, start, nominal, branch, held, False, STEPS, PRECISION, room)
            cost = true_cost(rules, grid, start, nominal, branch, room.scratch)
            if cost < (1.0 - GAIN) * costs[s]:
                path[:] = branch
                costs[s] = cost


@kernel
def _blend(a, b, middle, width, out):
    """Goes over from path ``a`` to path ``b`` around the knot ``middle``; ``out`` may be one of them."""
    for k in range(out.shape[0]):
        share = min(max((k - middle) / width + 0.5, 0.0), 1.0)
        for j in range(out.shape[1]):
            out[k, j] = (1.0 - share) * a[k, j] + share * b[k, j]


@kernel
def _errors(rules, nominal):
    """e, the components of the tracking error."""
    return 6 if rules.kind == task_kernels.POSE else nominal.shape[1]
