"""Kernels: damped Newton steps on the block-tridiagonal system of a joint path, in time linear in its knots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.solvers.linear_algebra import cholesky, inverse_of_factor
from baselines.solvers.receding_horizon.newton.cost import Blocks, Scratch, blocks_for, linearise, merit, scratch_for
from ikgym.jit import kernel

CONVERGED, RAN_OUT, STALLED = 0, 1, 2
# A decrease counts if it is this share of what the slope promises (Armijo).
SUFFICIENT = 1e-4
# The multipliers are brought up to date where Newton's method promises less than this share of what they leave open.
SETTLED = 0.1
# Limits become so much firmer where a renewal leaves more than this share of what the one before left open; at most.
FIRMER, SLOW, FIRMEST = 10.0, 0.3, 1e6
# Lengths of a step tried one after the other.
SHORTENING = 0.3
TRIALS = 6
# Costs below this are no more than rounding.
NEGLIGIBLE = 1e-12
# Damping added to the Hessian's diagonal, in units of (Δt / Δq̇)⁻²: least above 0, factors, and where to give up.
LEAST_DAMPING, MORE, LESS, MOST_DAMPING = 1e-6, 10.0, 0.1, 1e12


class Room(NamedTuple):
    """Arrays that a solve works in, for paths of up to K knots."""

    scratch: Scratch
    blocks: Blocks
    inverse: npt.NDArray[np.float64]
    factor: npt.NDArray[np.float64]
    step: npt.NDArray[np.float64]
    trial: npt.NDArray[np.float64]


@kernel
def room_for(kind, m, knots, n):
    """Room for paths of up to ``knots`` knots of ``n`` joints, and task coordinates of ``m`` numbers."""
    return Room(
        scratch_for(kind, m, n),
        blocks_for(knots, n),
        np.empty((knots, n, n)),
        np.empty((n, n)),
        np.empty((knots, n)),
        np.empty((knots, n)),
    )


@kernel
def newton_step(blocks, knots, exact, damping, inverse, factor, step):
    """Solves (H + damping I) step = -gradient by blocks, from the first knot to the last and back.

    Args:
        blocks: The quadratic model.
        knots: How many knots there are.
        exact: Whether to take the Hessian itself instead of its Gauss–Newton part.
        damping: Added to the diagonal.
        inverse: Receives the inverses of the pivots. Shape (K, n, n).
        factor: Scratch. Shape (n, n).
        step: Receives the step. Shape (K, n).

    Returns:
        False where the matrix is not positive definite; the step is of no use then.
    """
    n = step.shape[1]
    for k in range(knots):
        diagonal, second = blocks.diagonal[k], blocks.second[k]
        for a in range(n):
            for b in range(a + 1):
                factor[a, b] = diagonal[a, b] + second[a, b] if exact else diagonal[a, b]
            factor[a, a] += damping
            step[k, a] = -blocks.gradient[k, a]
        if k > 0:
            coupling, before = blocks.coupling[k], inverse[k - 1]
            for a in range(n):
                carried = 0.0
                for b in range(n):
                    carried += before[a, b] * step[k - 1, b]
                step[k, a] += coupling[a] * carried
                for b in range(a + 1):
                    factor[a, b] -= coupling[a] * before[a, b] * coupling[b]
        if not cholesky(factor):
            return False
        inverse_of_factor(factor, inverse[k])
    for k in range(knots - 1, -1, -1):
        if k + 1 < knots:
            for a in range(n):
                step[k, a] += blocks.coupling[k + 1, a] * step[k + 1, a]
        # factor's first row holds the result while the right-hand side is still needed
        for a in range(n):
            total = 0.0
            for b in range(n):
                total += inverse[k, a, b] * step[k, b]
            factor[0, a] = total
        for a in range(n):
            step[k, a] = factor[0, a]
    return True


@kernel
def minimise(rules, grid, start, nominal, path, multipliers, exact, most, tolerance, room):
    """Damped Newton steps from a path, until it is a minimum or they run out.

    Args:
        rules: A :class:`baselines.solvers.receding_horizon.newton.cost.Rules`.
        grid: The grid, of K knots.
        start: Joint coordinates now. Shape (n,).
        nominal: Nominal task coordinates 1, 2, … steps ahead. Shape (at least grid.at[-1], m).
        path: Joint coordinates at the knots, changed in place. Shape (K, n).
        multipliers: λ of the kinks and limits, changed in place. Shape (K, e + 2 n).
        exact: Whether to try the Hessian itself where it is positive definite; its Gauss–Newton part otherwise.
        most: Newton steps at most.
        tolerance: Relative precision of the cost.
        room: A :class:`Room`.

    Returns:
        CONVERGED, RAN_OUT or STALLED; the steps made; the cost (where they ran out the merit, which is not above it);
        the norm of the merit's gradient by q (where they ran out that before the last step).
    """
    knots, n = path.shape
    blocks, step, trial = room.blocks, room.step[:knots], room.trial[:knots]
    unit = 1.0 / (rules.dt * rules.cost.delta_qdot) ** 2
    firmness, left_open = room.scratch.firmness, np.inf
    firmness[0] = 1.0
    value, true, gap = linearise(rules, grid, start, nominal, path, multipliers, True, exact, room.scratch, blocks)
    made, outcome, renewed, damping = 0, RAN_OUT, True, 0.0
    while True:
        curved = exact
        while not newton_step(blocks, knots, curved, damping * unit, room.inverse, room.factor, step):
            if curved:
                curved = False
            else:
                damping = max(MORE * damping, LEAST_DAMPING)
                if damping > MOST_DAMPING:
                    break
        slope = 0.0
        for k in range(knots):
            for a in range(n):
                slope += blocks.gradient[k, a] * step[k, a]
        if not (np.isfinite(slope) and damping <= MOST_DAMPING):
            outcome = STALLED
            break
        promised = -0.5 * slope
        if promised + gap <= tolerance * true + NEGLIGIBLE and damping <= 1e-3:
            outcome = CONVERGED
            break
        if not renewed and promised <= SETTLED * min(gap, gap * gap):
            # Near the bottom for these multipliers, which are not yet those of the minimum. Renewed once more at the
            # same path they would overshoot, and those of limits, which have no bound, would swing for ever.
            made += 1
            renewed = True
            if gap > SLOW * left_open:
                firmness[0] = min(FIRMER * firmness[0], FIRMEST)
            left_open = gap
            if made >= most:
                break
            value, true, gap = linearise(
                rules, grid, start, nominal, path, multipliers, True, exact, room.scratch, blocks
            )
            continue
        length, accepted = 1.0, False
        for _ in range(TRIALS):
            for k in range(knots):
                for a in range(n):
                    trial[k, a] = path[k, a] + length * step[k, a]
            reached = merit(rules, grid, start, nominal, trial, multipliers, room.scratch)
            if reached <= value + SUFFICIENT * length * slope:
                accepted = True
                break
            length *= SHORTENING
        made += 1
        if not accepted and made < most:
            if promised <= 1e-13 * abs(value):
                # Rounding hides what is left to gain.
                outcome = CONVERGED if gap <= 10.0 * tolerance * true else STALLED
                break
            damping = max(MORE * damping, LEAST_DAMPING)
            continue
        if not accepted:
            break
        for k in range(knots):
            for a in range(n):
                path[k, a] = trial[k, a]
        true, renewed = reached, False
        if made == most:
            break
        if length == 1.0:
            damping = damping * LESS if damping > LEAST_DAMPING else 0.0
        elif length < SHORTENING:
            damping = max(MORE * damping, LEAST_DAMPING)
        value, true, gap = linearise(rules, grid, start, nominal, path, multipliers, False, exact, room.scratch, blocks)
    square = 0.0
    for k in range(knots):
        for a in range(n):
            square += blocks.gradient[k, a] * blocks.gradient[k, a]
    return outcome, made, true, np.sqrt(square)
