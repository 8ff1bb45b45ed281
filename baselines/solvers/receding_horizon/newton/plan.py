"""Kernels: the initial plan of an episode, the plan shifted by one step, and restart candidates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.solvers.receding_horizon.newton.clearance import wait_clear
from baselines.solvers.receding_horizon.newton.grid import Grid, empty_grid, shift_multipliers, shift_path
from baselines.solvers.receding_horizon.newton.guess import DAMPING, STREAM, draw, initial_guess, slow_down, uniform
from baselines.solvers.receding_horizon.newton.interior_point import cost_within, minimise_path
from baselines.solvers.receding_horizon.newton.minimise import NewtonSettings
from baselines.solvers.receding_horizon.newton.workspace import NewtonWorkspace, newton_workspace
from ikgym.kernels.jit import expanded, inner, uncounted

Floats = npt.NDArray[np.float64]

# Newton steps of each of several initial guesses, and how exactly they are minimised before they are compared.
STEPS_OF_A_START, TOLERANCE_OF_A_START = 30, 1e-4
# A restart candidate is given up if its cost exceeds this multiple of the plan's after this number of Newton steps.
HOPELESS, TRIED = 10.0, 5
# Likewise after `start_steps` of them, where initial guesses are tried one after the other as candidates.
UNPROMISING = 2.0
# μ of a plan under limits of acceleration that has few Newton steps a period, in units of the cost for each knot.
SMOOTHING = 1e-2
# By which share such a plan may leave a limit and replace another one.
LOOSE = 1e-3
# A restart candidate replaces the plan only for a gain that is worth the jump.
GAIN = 1e-3


class Plan(NamedTuple):
    """A joint path and the multipliers of its kinks and limits.

    Attributes:
        path: Joint coordinates at the knots in [rad] or [m]. Shape (K, n).
        multipliers: λ. Shape (K, e + 2 n).
    """

    path: Floats
    multipliers: Floats


class PlanWorkspace(NamedTuple):
    """Arrays that the rows of a call use one after the other.

    Attributes:
        newton: Arrays of Newton's method.
        kept: The best plan so far.
        drift: Drift of a random guess, in [rad/s] or [m/s]. Shape (n,).
        passed: q̇ Δt of the step that has passed. Shape (n,).
        away: How far plans of the period before are moved, in [rad] or [m]. Shape (n,).
        grid: Of the plan.
        old_grid: Of the plan of the period before.
    """

    newton: NewtonWorkspace
    kept: Plan
    drift: Floats
    passed: Floats
    away: Floats
    grid: Grid
    old_grid: Grid


@inner
def plan_workspace(kind, m, knots, n, width, limited, clearance):
    """The workspace for plans of ``knots`` knots and ``width`` multipliers a knot; see :func:`newton_workspace`."""
    kept = plan_in(np.empty(knots * (n + width)), knots, n)
    newton, vectors = newton_workspace(kind, m, knots, n, limited, clearance), np.empty((3, n))
    return PlanWorkspace(newton, kept, vectors[0], vectors[1], vectors[2], empty_grid(knots), empty_grid(knots))


@expanded
def plan_in(block, knots, n):
    """The plan in a block of numbers: the path of ``knots`` knots and ``n`` joints, then the multipliers."""
    end = knots * n
    return Plan(block[:end].reshape(knots, n), block[end:].reshape(knots, block.shape[0] // knots - n))


@expanded
def first_part(plan, knots):
    """The first knots of a plan, as views."""
    return Plan(plan.path[:knots], plan.multipliers[:knots])


@uncounted
def shift_plan(old_grid, plan, grid, workspace):
    """Shifts a plan by one step, and moves it by ``workspace.away``, in place; ``workspace.passed`` is set, too.

    The plan has at least as many knots as either grid; the new grid is counted from one step later.
    """
    shifted, away = workspace.kept.path, workspace.away
    shift_path(old_grid, plan.path, workspace.passed, grid, shifted)
    shift_multipliers(old_grid, plan.multipliers, grid)
    for k in range(grid.at.shape[0]):
        for j in range(plan.path.shape[1]):
            plan.path[k, j] = shifted[k, j] + away[j]


@inner
def initial_plan(problem, settings, plan, workspace):
    """The initial plan of an episode: the cheapest of several initial guesses, each a few Newton steps on.

    The :class:`Plan` receives it. Gives the Newton steps made.
    """
    made, best = 0, np.inf
    trials = 1 if settings.start_steps > 0 else settings.starts
    knots, newton = plan.path.shape[0], workspace.newton
    kept = first_part(workspace.kept, knots)
    for trial in range(trials):
        damping = DAMPING
        workspace.drift[:] = 0.0
        if trial > 0:
            damping = draw(settings.seed, trial, workspace.drift)
        _guess(problem, settings, 0, damping, plan.path, workspace)
        plan.multipliers[:] = 0.0
        if trials == 1:
            return 0
        coarse = NewtonSettings(False, STEPS_OF_A_START, TOLERANCE_OF_A_START)
        minimum = minimise_path(problem, plan.path, plan.multipliers, coarse, 0.0, newton)
        made += minimum.steps
        value = max(minimum.cost, cost_within(problem, plan.path, LOOSE, newton))
        if value < best:
            best = value
            _copy(plan, kept)
    if best < np.inf:
        _copy(kept, plan)
    return made


@uncounted
def _guess(problem, settings, first, damping, path, workspace):
    """An initial guess from knot ``first`` on, with the drift in the workspace; slowed down where plans may recover."""
    initial_guess(problem, first, workspace.drift, damping, path, workspace.newton.knot)
    if settings.recovery_steps > 0:
        slow_down(problem, path)
    wait_clear(problem.clearance, problem, first, path, workspace.newton)


@inner
def try_start(problem, settings, steps, plan, cost, number, workspace):
    """Improves a random guess by some Newton steps; it replaces the plan where it is cheaper.

    Args:
        problem: See :mod:`newton`.
        settings: :class:`settings.PlanSettings`.
        steps: Newton steps.
        plan: The :class:`Plan`.
        cost: The cost of the plan.
        number: Which random guess of the seed.
        workspace: A :class:`PlanWorkspace`.

    Returns:
        Newton steps made.
    """
    guess, newton = first_part(workspace.kept, plan.path.shape[0]), workspace.newton
    damping = draw(settings.seed, number, workspace.drift)
    _guess(problem, settings, 0, damping, guess.path, workspace)
    guess.multipliers[:] = 0.0
    few = NewtonSettings(False, steps, TOLERANCE_OF_A_START)
    minimum = minimise_path(problem, guess.path, guess.multipliers, few, 0.0, newton)
    if max(minimum.cost, cost_within(problem, guess.path, LOOSE, newton)) < (1.0 - GAIN) * cost:
        _copy(guess, plan)
    return minimum.steps


@inner
def branch_off(problem, settings, plan, anew, number, candidate, workspace):
    """Begins a restart candidate: the plan up to a random knot, and from there on a random guess.

    Args:
        problem: See :mod:`newton`.
        settings: :class:`settings.PlanSettings`.
        plan: The :class:`Plan`.
        anew: Whether to branch off at once.
        number: Which random guess of the seed.
        candidate: Receives the candidate, a :class:`Plan` of at least K knots.
        workspace: A :class:`PlanWorkspace`.
    """
    knots = plan.path.shape[0]
    branch = 0 if anew else int(uniform(settings.seed, STREAM * number) * knots)
    candidate.path[:branch] = plan.path[:branch]
    candidate.multipliers[:branch] = plan.multipliers[:branch]
    candidate.multipliers[branch:] = 0.0
    damping = draw(settings.seed, number, workspace.drift)
    _guess(problem, settings, branch, damping, candidate.path[:knots], workspace)


@inner
def improve_candidate(problem, settings, rate, plan, cost, candidate, age, workspace):
    """Improves a restart candidate by some Newton steps; it replaces the plan where it is cheaper.

    Args:
        problem: See :mod:`newton`.
        settings: :class:`settings.PlanSettings`.
        rate: Newton steps.
        plan: The :class:`Plan`.
        cost: The cost of the plan.
        candidate: The candidate, a :class:`Plan` of K knots.
        age: Newton steps that the candidate has had; 0 after its last. Shape (1,).
        workspace: A :class:`PlanWorkspace`.

    Returns:
        Newton steps made.
    """
    newton, early = workspace.newton, settings.start_steps > 0
    few = NewtonSettings(False, rate, settings.tolerance)
    minimum = minimise_path(problem, candidate.path, candidate.multipliers, few, SMOOTHING, newton)
    age[0] += rate
    last, tried = age[0] >= settings.restart_steps, settings.start_steps if early else TRIED
    if (early or last) and minimum.cost < (1.0 - GAIN) * cost:
        true = cost_within(problem, candidate.path, LOOSE, newton)
        if true < (1.0 - GAIN) * cost:
            age[0] = 0
            _copy(candidate, plan)
    if last or (age[0] >= tried and not minimum.cost < (UNPROMISING if early else HOPELESS) * cost):
        age[0] = 0
    return minimum.steps


@inner
def _copy(plan, out):
    out.path[:] = plan.path
    out.multipliers[:] = plan.multipliers
