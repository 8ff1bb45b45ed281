"""Kernels: the cheapest joint path under limits of acceleration, by a primal-dual interior point method.

Limits of acceleration couple three knots, and in a horizon that makes up for an error most of them are active: chains
of double integrators, on which multipliers of an augmented Lagrangian settle slowly. An interior point method takes
some thirty Newton steps, whatever is active: the barrier parameter is followed to 0.
"""

from __future__ import annotations

import numpy as np

from baselines.solvers.receding_horizon.newton.barrier import ANEW, KEPT, Barrier, change_steps, linearise, merit
from baselines.solvers.receding_horizon.newton.clearance import clearance_excess, clearance_left
from baselines.solvers.receding_horizon.newton.cost import true_cost
from baselines.solvers.receding_horizon.newton.minimise import (
    CONVERGED,
    MOST_DAMPING,
    NEGLIGIBLE,
    RAN_OUT,
    STALLED,
    SUFFICIENT,
    Minimum,
    damped_newton_step,
    minimise,
    more_damping,
    next_damping,
    scalar_product,
)
from baselines.solvers.receding_horizon.newton.terms import BARRIER_SIZE, BEYOND
from ikgym.kernels.jit import uncounted
from ikgym.kernels.limits import FASTEST, LOWER, UPPER

# μ at the beginning, and w of the limits, in units of the cost for each knot, or of this where that is less. Where the
# path leaves limits μ is larger by how much it does, up to a bound: else the barrier function has a kink in its way.
FIRST_MU, LIMIT_WEIGHT, LEAST_UNIT = 0.1, 100.0, 1e-2
EXCESS_MU, LARGEST_MU = 1.0, 100.0
# μ falls by the first factor, and later to its power (Wächter and Biegler 2006, eq. 7), down to a share of the cost.
FALL, POWER, LEAST_MU = 0.2, 1.25, 1e-11
# μ falls where less than this multiple of μ is left to gain, or this share of the barrier function, which is rounding.
NEAR, ROUNDING = 1.0, 1e-13
# The finest relative precision of the cost: below it the slacks of active limits are rounding.
FINEST = 1e-9
# w of the limits grows where one is left by more than this share of its scale, and by more than this multiple of
# μ / w, which is the effect of μ alone: its multiplier would be above w. Where that does not help no path keeps them.
LEFT, BY_MU, GROWTH, LARGEST_GROWTH = 1e-6, 10.0, 10.0, 1e3
# Lengths of a step tried one after the other.
SHORTENING, TRIALS = 0.5, 16


@uncounted
def minimise_limited(problem, path, settings, smoothing, workspace):
    """Damped Newton steps on the barrier function, until the path is a minimum or they run out.

    Args:
        problem: See :mod:`newton`; with limits of acceleration, which may be infinite.
        path: See :mod:`newton`; changed in place.
        settings: :class:`NewtonSettings`.
        smoothing: μ throughout, in units of the cost for each knot, for few steps from a path that is almost a minimum;
            0 to follow it down to the tolerance.
        workspace: See :mod:`newton`.

    Returns:
        A :class:`Minimum`; STALLED where no path keeps the limits, too.
    """
    knots, bounds = path.shape[0], workspace.barriers[: path.shape[0]].size // BARRIER_SIZE
    gradient, step, trial = workspace.model.gradient[:knots], workspace.step[:knots], workspace.trial[:knots]
    unit = 1.0 / (problem.data.dt * problem.data.cost.delta_qdot) ** 2
    cost = max(true_cost(problem, path, workspace), NEGLIGIBLE)
    share, growth = max(cost / knots, LEAST_UNIT), 1.0
    left = excess(problem, path, workspace)
    mu = (smoothing if smoothing > 0.0 else min(max(FIRST_MU, EXCESS_MU * left), LARGEST_MU)) * share
    barrier, smooth = Barrier(mu, LIMIT_WEIGHT * share), smoothing > 0.0
    value = linearise(problem, path, barrier, ANEW, settings.exact, workspace)
    made, outcome, damping, tolerance = 0, RAN_OUT, 0.0, max(settings.tolerance, FINEST)
    last = mu if smooth else 0.0
    while made < settings.steps:
        damping = damped_newton_step(problem, settings.exact, damping, unit, workspace, step)
        derivative = scalar_product(gradient, step)
        if not (np.isfinite(derivative) and damping <= MOST_DAMPING):
            outcome = STALLED
            break
        enough = tolerance * cost if mu <= last else NEAR * mu
        if -0.5 * derivative <= max(enough, ROUNDING * abs(value)):
            cost = max(true_cost(problem, path, workspace), NEGLIGIBLE)
            last = mu if smooth else max(tolerance / bounds, LEAST_MU) * cost
            slack = max(LEFT, BY_MU * mu / barrier.limit_weight)
            left = limits_left(workspace, knots, slack)
            left = left or clearance_left(problem.clearance, workspace.clearance, knots, slack)
            if left and (smooth or growth >= LARGEST_GROWTH):
                outcome = STALLED
                break
            if mu <= last and not left:
                outcome = CONVERGED
                break
            growth *= GROWTH if left else 1.0
            mu = max(last, min(FALL * mu, mu * (mu / cost) ** (POWER - 1.0)))
            barrier = Barrier(mu, growth * LIMIT_WEIGHT * max(cost / knots, LEAST_UNIT))
            value = linearise(problem, path, barrier, KEPT, settings.exact, workspace)
            continue
        made += 1
        length = _line_search(problem, path, barrier, value, derivative, step, trial, workspace)
        if length == 0.0:
            damping = more_damping(damping)
            continue
        for k in range(knots):
            for a in range(path.shape[1]):
                path[k, a] = trial[k, a]
        damping = next_damping(damping, length)
        value = linearise(problem, path, barrier, length, settings.exact, workspace)
    return Minimum(outcome, made, true_cost(problem, path, workspace), np.sqrt(scalar_product(gradient, gradient)))


@uncounted
def minimise_path(problem, path, multipliers, settings, smoothing, workspace):
    """The minimum of a joint path: by the interior point method where ``change_limit`` is there, or by multipliers.

    The arguments are those of :func:`minimise.minimise` and, for the former, the smoothing of :func:`minimise_limited`.
    """
    if problem.change_limit.shape[0] > 0:
        return minimise_limited(problem, path, settings, smoothing, workspace)
    return minimise(problem, path, multipliers, settings, workspace)


@uncounted
def limits_left(workspace, knots, slack):
    """Whether the path of K knots leaves a limit by more than a share of its scale."""
    barriers, e = workspace.barriers, workspace.knot.error.shape[0]
    for k in range(knots):
        for i in range(e, barriers.shape[1]):
            if barriers[k, i, 0, BEYOND] > slack or barriers[k, i, 1, BEYOND] > slack:
                return True
    return False


@uncounted
def _line_search(problem, path, barrier, value, derivative, step, trial, workspace):
    """Shortens a step until the barrier function decreases enough (Armijo): its length, 0 for none."""
    length = 1.0
    for _ in range(TRIALS):
        for k in range(path.shape[0]):
            for a in range(path.shape[1]):
                trial[k, a] = path[k, a] + length * step[k, a]
        reached = merit(problem, trial, barrier, workspace)
        if reached <= value + SUFFICIENT * length * derivative + ROUNDING * abs(value):
            return length
        length *= SHORTENING
    return 0.0


@uncounted
def excess(problem, path, workspace):
    """By how much a path leaves its limits, at most: a share of them, and of positions in units of the largest step.

    Not above 0 where all limits are kept. Braking behind the last knot is not looked at.
    """
    data, lengths, start = problem.data, problem.grid.length, problem.start
    lower, upper, limits, changes = data.limits[LOWER], data.limits[UPPER], data.limits[FASTEST], problem.change_limit
    limited, dt, before = changes.shape[0] > 0, data.dt, workspace.before
    most = clearance_excess(problem.clearance, problem, path, workspace)
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
    """The cost of a path; infinite where accelerations are limited and the path leaves a limit by more than a share."""
    if problem.change_limit.shape[0] > 0 and excess(problem, path, workspace) > slack:
        return np.inf
    return true_cost(problem, path, workspace)
