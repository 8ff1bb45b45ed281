"""Kernel: Newton's method for a joint path, with line search, damping and updates of the multipliers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from baselines.solvers.receding_horizon.newton.cost import linearise, merit
from baselines.solvers.receding_horizon.newton.newton_step import newton_step, pentadiagonal_step
from ikgym.kernels.jit import inlined, uncounted

CONVERGED, RAN_OUT, STALLED = 0, 1, 2
# A decrease counts if it is this share of the decrease that the gradient predicts (Armijo).
SUFFICIENT = 1e-4
# The multipliers are updated where Newton's method predicts less than this share of the violation left.
UPDATE_BELOW = 0.1
# The penalties of the limits grow by a factor where an update leaves more than this share of the violation before
# open, and up to a bound.
PENALTY_GROWTH, SLOW, LARGEST_PENALTY = 10.0, 0.3, 1e6
# Lengths of a step tried one after the other.
SHORTENING = 0.3
TRIALS = 6
# Costs below this are no more than rounding, as are promised decreases below this share of the merit.
NEGLIGIBLE, ROUNDING = 1e-12, 1e-13
# With a larger damping a small promise is no sign of a minimum.
CONVERGED_DAMPING = 1e-3
# Damping added to the Hessian's diagonal, in units of (Δt / Δq̇)⁻²: least above 0, factors, and where to give up.
LEAST_DAMPING, MORE, LESS, MOST_DAMPING = 1e-6, 10.0, 0.1, 1e12


class NewtonSettings(NamedTuple):
    """Stopping criteria of a minimisation.

    Attributes:
        exact: Whether to try the Hessian itself where it is positive definite; its Gauss–Newton part otherwise.
        steps: Newton steps at most.
        tolerance: Relative precision of the cost.
    """

    exact: bool
    steps: int
    tolerance: float


class Minimum(NamedTuple):
    """Result of a minimisation.

    Attributes:
        outcome: CONVERGED, RAN_OUT or STALLED.
        steps: Newton steps made, updates of the multipliers among them.
        cost: The cost (where the steps ran out the merit, which is not above it).
        gradient_norm: Norm of the merit's gradient by q (where the steps ran out that before the last one).
    """

    outcome: int
    steps: int
    cost: float
    gradient_norm: float


@uncounted
def minimise(problem, path, multipliers, settings, workspace):
    """Damped Newton steps from a path, until it is a minimum or they run out.

    The method of multipliers: the merit function is minimised for fixed multipliers, and where little is left to gain
    with these they are updated.

    Args:
        problem: See :mod:`newton`.
        path: See :mod:`newton`; changed in place.
        multipliers: See :mod:`newton`; changed in place.
        settings: :class:`NewtonSettings`.
        workspace: See :mod:`newton`.

    Returns:
        A :class:`Minimum`.
    """
    data, exact, tolerance = problem.data, settings.exact, settings.tolerance
    knots = path.shape[0]
    model = workspace.model
    gradient, step, trial = model.gradient[:knots], workspace.step[:knots], workspace.trial[:knots]
    unit = 1.0 / (data.dt * data.cost.delta_qdot) ** 2
    penalty_factor, left_open = workspace.knot.penalty_factor, np.inf
    penalty_factor[0] = 1.0
    value, true, gap = linearise(problem, path, multipliers, True, exact, workspace)
    made, outcome, updated, damping = 0, RAN_OUT, True, 0.0
    while True:
        damping = damped_newton_step(problem, exact, damping, unit, workspace, step)
        derivative = scalar_product(gradient, step)
        if not (np.isfinite(derivative) and damping <= MOST_DAMPING):
            outcome = STALLED
            break
        promised = -0.5 * derivative
        if promised + gap <= tolerance * true + NEGLIGIBLE and damping <= CONVERGED_DAMPING:
            outcome = CONVERGED
            break
        if not updated and promised <= UPDATE_BELOW * min(gap, gap * gap):
            # Near the minimum for these multipliers, which are not yet final. Updated once more at the same path
            # they would overshoot, and those of limits, which have no bound, would oscillate without end.
            made, updated = made + 1, True
            penalty_factor[0] = _penalty_factor(penalty_factor[0], gap, left_open)
            left_open = gap
            if made >= settings.steps:
                break
            value, true, gap = linearise(problem, path, multipliers, True, exact, workspace)
            continue
        accepted, length, reached = line_search(problem, path, multipliers, value, derivative, step, trial, workspace)
        made += 1
        if not accepted:
            if made >= settings.steps:
                break
            if promised <= ROUNDING * abs(value):
                # The rest of the gain is below rounding.
                outcome = CONVERGED if gap <= 10.0 * tolerance * true else STALLED
                break
            damping = more_damping(damping)
            continue
        for k in range(knots):
            for a in range(path.shape[1]):
                path[k, a] = trial[k, a]
        true, updated = reached, False
        if made == settings.steps:
            break
        damping = next_damping(damping, length)
        value, true, gap = linearise(problem, path, multipliers, False, exact, workspace)
    return Minimum(outcome, made, true, np.sqrt(scalar_product(gradient, gradient)))


@uncounted
def damped_newton_step(problem, exact, damping, unit, workspace, step):
    """A Newton step with the least damping, from ``damping`` up, that makes the Hessian positive definite.

    Where the exact Hessian is not positive definite its Gauss–Newton part is taken before any damping is added. The
    damping is in units of ``unit``, (Δt Δq̇)⁻². Gives that of the step, above MOST_DAMPING where none was found.
    """
    model, inverse, factor = workspace.model, workspace.inverse, workspace.factor
    second = exact
    while True:
        if problem.rate_weight > 0.0 or problem.change_limit.shape[0] > 0:
            done = pentadiagonal_step(model, second, damping * unit, inverse, factor, step)
        else:
            done = newton_step(model, second, damping * unit, inverse, factor, step)
        if done:
            break
        if second:
            second = False
        else:
            damping = more_damping(damping)
            if damping > MOST_DAMPING:
                break
    return damping


@uncounted
def line_search(problem, path, multipliers, value, derivative, step, trial, workspace):
    """Shortens a step until the merit decreases enough (Armijo).

    ``value`` and ``derivative`` are the merit at the path and its derivative along the step; ``trial`` receives the
    path at the last trial.

    Returns:
        Whether a trial decreased the merit enough, the length of the step, and the merit at the last trial.
    """
    length, reached, accepted = 1.0, value, False
    for _ in range(TRIALS):
        for k in range(path.shape[0]):
            for a in range(path.shape[1]):
                trial[k, a] = path[k, a] + length * step[k, a]
        reached = merit(problem, trial, multipliers, workspace)
        if reached <= value + SUFFICIENT * length * derivative:
            accepted = True
            break
        length *= SHORTENING
    return accepted, length, reached


@inlined
def _penalty_factor(factor, gap, left_open):
    """The factor of the limits' penalties: larger where an update of the multipliers has closed too little."""
    return min(PENALTY_GROWTH * factor, LARGEST_PENALTY) if gap > SLOW * left_open else factor


@inlined
def next_damping(damping, length):
    """The damping after an accepted step: less after a full one, more after one shortened more than once."""
    if length == 1.0:
        return damping * LESS if damping > LEAST_DAMPING else 0.0
    return more_damping(damping) if length < SHORTENING else damping


@inlined
def more_damping(damping):
    """The damping after a step that was of no use."""
    return max(MORE * damping, LEAST_DAMPING)


@inlined
def scalar_product(a, b):
    """The scalar product of two matrices. Shapes (K, n)."""
    total = 0.0
    for k in range(a.shape[0]):
        for j in range(a.shape[1]):
            total += a[k, j] * b[k, j]
    return total
