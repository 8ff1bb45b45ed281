"""Kernel: one control period of a receding horizon, row by row."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.solvers.near_bodies import bodies_of
from baselines.solvers.receding_horizon.newton.bodies import INFLUENCE, Clearance
from baselines.solvers.receding_horizon.newton.clearance import keep_clear
from baselines.solvers.receding_horizon.newton.grid import cut, first_knots
from baselines.solvers.receding_horizon.newton.interior_point import minimise_path
from baselines.solvers.receding_horizon.newton.minimise import CONVERGED, NewtonSettings
from baselines.solvers.receding_horizon.newton.plan import (
    SMOOTHING,
    branch_off,
    first_part,
    improve_candidate,
    initial_plan,
    plan_in,
    plan_workspace,
    shift_plan,
    try_start,
)
from baselines.solvers.receding_horizon.newton.settings import settings_of
from baselines.solvers.receding_horizon.newton.workspace import PathProblem
from baselines.status import Status
from ikgym.kernels.jit import expanded, inlined, kernel, uncounted
from ikgym.kernels.limits import FASTEST, LOWER, UPPER

_CONVERGED, _LIMIT, _SATURATED = int(Status.CONVERGED), int(Status.ITERATION_LIMIT), int(Status.SATURATED)

# Tolerance of the velocity limit in a plan, as a share of it.
KEPT = 1e-5
# Newton steps of the initial plan at least, and of a plan that is to be brought to its optimum.
STEPS_OF_THE_FIRST, STEPS_TO_THE_OPTIMUM = 30, 300
# Periods that share the Newton steps of the initial plan where guesses are spread over periods, and those of the first.
PERIODS_OF_THE_FIRST, SHARE_OF_THE_FIRST = 2, 0.4
# Number of periods beyond the velocity limits after which another plan is begun.
RETRY = 4


class HorizonMemory(NamedTuple):
    """Memory of the receding horizons of B arms.

    Attributes:
        plans: The plan and, where there is one, the restart candidate, see :func:`plan.plan_in`: joint coordinates at
            the K knots in [rad] or [m], then e + 2 n multipliers a knot. Shape (B, 1 or 2, K (e + 3 n)).
        counts: PERIODS planned so far, CANDIDATE_STEPS that the candidate has had (a guess that has a whole period
            counts as one), initial guesses TRIED so far, and how many periods in a row have ended FAR beyond the
            velocity limits. Shape (B, 4).
        q: Joint coordinates of the period before, in [rad] or [m]. Shape (B, n).
    """

    plans: npt.NDArray[np.float64]
    counts: npt.NDArray[np.int64]
    q: npt.NDArray[np.float64]


PERIODS, CANDIDATE_STEPS, TRIED, FAR = range(4)


@kernel
def plan_step(model, numbers, batch, solution):
    """Plans one period for each of B arms; see :class:`CompiledPolicy` for the arguments.

    The iterations are the Newton steps made, those of initial guesses and candidates among them.
    """
    plan_rows(model, numbers, batch, solution, None)


@kernel
def plan_step_among(model, numbers, batch, solution):
    """The same among bodies, with the obstacles held still over the horizon where they will be after the step."""
    shapes, checked = bodies_of(numbers.bodies)
    influence = numbers.clearance + INFLUENCE
    clearance = Clearance(shapes, numbers.boxes, checked, numbers.sweep, numbers.clearance, influence)
    plan_rows(model, numbers, batch, solution, clearance)


@expanded
def plan_rows(model, numbers, batch, solution, clearance):
    """:func:`plan_step` with a :class:`bodies.Clearance`, whose boxes are those of each row or of all, or with None."""
    n, plans = batch.q.shape[1], solution.memory.plans
    settings = settings_of(numbers.reals, numbers.integers, n)
    knots = settings.at.shape[0]
    limited, width = settings.change_limit.shape[0] > 0, plans.shape[2] // knots - n
    workspace = plan_workspace(model.kind, batch.nominal.shape[2], knots, n, width, limited, clearance)
    plan_batch(model, settings, batch, solution, clearance, workspace)


@uncounted
def plan_batch(data, settings, batch, solution, clearance, workspace):
    """Plans one period for each of B arms; the settings are :class:`PlanSettings`, other arguments as above."""
    plans, counts, before = solution.memory
    limited = settings.change_limit.shape[0] > 0
    around = clearance
    for row in range(batch.q.shape[0]):
        q, qdot_before, count = batch.q[row], batch.qdot[row], counts[row]
        if clearance is not None:  # the obstacles of this row
            first = row % clearance.boxes.shape[0]
            boxes = clearance.boxes[first : first + 1]
            around = Clearance(
                clearance.shapes, boxes, clearance.checked, clearance.sweep, clearance.margin, clearance.influence
            )
        grid, old_grid = _grids(settings, batch.remaining[row, 0], workspace)
        # Where the horizon ends with the episode nothing comes behind it.
        braking = not settings.stop_at_end or batch.remaining[row, 0] > settings.at[-1]
        problem = PathProblem(
            data,
            grid,
            q,
            batch.nominal[row],
            settings.joint_weights,
            qdot_before,
            settings.rate_weight,
            settings.change_limit,
            braking,
            workspace.newton.errors[:0],  # policies know of no payload
            around,
        )
        for j in range(q.shape[0]):
            workspace.passed[j] = qdot_before[j] * data.dt
            # Under limits the plan moves by what drives missed of the command. A jump to the old plan would leave the
            # acceleration limits, and a few Newton steps of the interior point method do not bring it back within.
            commanded = before[row, j] + data.dt * qdot_before[j]
            workspace.away[j] = q[j] - commanded if limited and count[PERIODS] > 0 else 0.0
            before[row, j] = q[j]
        minimum, made = _plan_row(problem, settings, old_grid, plans[row], count, workspace)
        count[PERIODS] += 1
        kept = _first_velocity(problem, plans[row, 0], solution.qdot[row])
        kept = keep_clear(around, problem, solution.qdot[row], workspace.newton.clearance) and kept
        count[FAR] = 0 if kept or settings.recovery_steps == 0 else count[FAR] + 1
        solution.status[row] = (_CONVERGED if minimum.outcome == CONVERGED else _LIMIT) if kept else _SATURATED
        solution.iterations[row] = made


@expanded
def _grids(settings, remaining, workspace):
    """The grid of this period, and that of the period before, which began one step earlier."""
    at, stop, weight = settings.at, settings.stop_at_end, settings.terminal_weight
    grid, old_grid, last = workspace.grid, workspace.old_grid, at[-1]
    left = int(min(max(remaining, 1.0), last + 1.0)) if stop else last
    old_knots = cut(at, left + 1 if stop else left, weight, old_grid)
    return first_knots(grid, cut(at, left, weight, grid)), first_knots(old_grid, old_knots)


@uncounted
def _plan_row(problem, settings, old_grid, plans, counts, workspace):
    """Plans a period of one arm, and improves its restart candidate.

    The plans (1 or 2, K (e + 3 n)) and counts (4,) of :class:`HorizonMemory` are changed in place.

    Returns:
        The :class:`Minimum` of the plan, and Newton steps made.
    """
    all_knots, knots, n = settings.at.shape[0], problem.grid.at.shape[0], problem.start.shape[0]
    period, far, spread = counts[PERIODS], counts[FAR], settings.start_steps > 0
    first = period < (PERIODS_OF_THE_FIRST if spread else 1)
    starting = spread and not first and counts[TRIED] + 1 < settings.starts
    retried = far > 0 and far % RETRY == 0
    steps = _newton_steps(settings, period if first else -1, far > 0 and not (starting or retried))
    whole = plan_in(plans[0], all_knots, n)
    minimum, made = _plan(problem, settings, steps, period, old_grid, whole, workspace)
    if far > 0 and not starting:
        counts[CANDIDATE_STEPS] = 0  # no time for the candidate, which is left behind
        if retried:
            plan, number = first_part(whole, knots), settings.starts + period
            made += try_start(problem, settings, settings.recovery_steps, plan, minimum.cost, number, workspace)
    elif settings.restart_steps > 0 and not first:
        made += _restart(problem, settings, old_grid, plans, counts, minimum.cost, starting, workspace)
    return minimum, made


@inlined
def _newton_steps(settings, first, hurried):
    """Newton steps of the plan in one period; -1 to the optimum.

    ``first`` is the number of the period among those of the first plan, -1 for later ones; ``hurried`` is whether the
    period before ended beyond the velocity limits, and there is time to make up for it.
    """
    if settings.iterations < 0:
        return -1
    # The first period has the initial guess besides, which takes as long as some Newton steps.
    begin = int(SHARE_OF_THE_FIRST * settings.start_steps)
    if first < 0:
        least = settings.recovery_steps if hurried else 0
    elif settings.start_steps > 0:
        least = begin if first == 0 else settings.start_steps - begin
    else:
        least = STEPS_OF_THE_FIRST
    return max(least, settings.iterations)


@uncounted
def _restart(problem, settings, old_grid, plans, counts, cost, starting, workspace):
    """Begins a restart candidate, or improves the present one; gives the Newton steps made.

    Args:
        problem: A :class:`PathProblem`.
        settings: :class:`PlanSettings`.
        old_grid: The grid of the candidate, that of the period before.
        plans: Of :class:`HorizonMemory`, changed in place. Shape (2, K (e + 3 n)).
        counts: Likewise. Shape (4,).
        cost: The cost of the plan.
        starting: Whether initial guesses are still to be tried.
        workspace: A :class:`PlanWorkspace`.
    """
    all_knots, knots, n = settings.at.shape[0], problem.grid.at.shape[0], problem.start.shape[0]
    plan, whole = first_part(plan_in(plans[0], all_knots, n), knots), plan_in(plans[1], all_knots, n)
    age, number = counts[CANDIDATE_STEPS : CANDIDATE_STEPS + 1], settings.starts + counts[PERIODS]
    begun = age[0] == 0
    if begun:
        branch_off(problem, settings, plan, starting, number, whole, workspace)
    else:
        shift_plan(old_grid, whole, problem.grid, workspace)
    # Newton steps of the interior point method take three times as long: no period has time for several of a guess.
    hasty = starting and problem.change_limit.shape[0] == 0
    rate, made = settings.start_steps if hasty else 1, 0
    counts[TRIED] += starting
    if begun and settings.start_steps > 0 and not starting:
        age[0] = 1  # a guess takes as long as a Newton step, and counts as one: no period has time for both
    else:
        candidate = first_part(whole, knots)
        made = improve_candidate(problem, settings, rate, plan, cost, candidate, age, workspace)
    return made


@uncounted
def _plan(problem, settings, most, period, old_grid, plan, workspace):
    """Plans a period of one arm, from the plan of the period before or from an initial guess.

    ``most`` is the number of Newton steps behind initial guesses, -1 to the optimum; the plan is changed in place.

    Returns:
        The :class:`Minimum`, and Newton steps made, those of initial guesses among them.
    """
    part = first_part(plan, problem.grid.at.shape[0])
    made, exact, steps = 0, most < 0, most
    if period == 0:
        made = initial_plan(problem, settings, part, workspace)
    else:
        shift_plan(old_grid, plan, problem.grid, workspace)
    if exact:
        steps = STEPS_TO_THE_OPTIMUM
    newton = NewtonSettings(exact, steps, settings.tolerance)
    smoothing = 0.0 if exact or period == 0 else SMOOTHING
    minimum = minimise_path(problem, part.path, part.multipliers, newton, smoothing, workspace.newton)
    return minimum, made + minimum.steps


@inlined
def _first_velocity(problem, target, qdot):
    """The joint velocities of a plan's first block, within all limits.

    ``target`` is the first knot, and ``qdot`` receives the velocities. Shapes (at least n,) and (n,).

    Returns:
        Whether the plan keeps the limits of velocity and acceleration.
    """
    data, q, before, changes, kept = problem.data, problem.start, problem.qdot_before, problem.change_limit, True
    length, limited = problem.grid.length[0], changes.shape[0] > 0
    for j in range(q.shape[0]):
        # A limit that holds the plan is kept to the tolerance only; NaN stays NaN.
        here, lower, upper, limit = target[j], data.limits[LOWER, j], data.limits[UPPER, j], data.limits[FASTEST, j]
        if here < lower:
            here = lower
        elif here > upper:
            here = upper
        velocity = (here - q[j]) / (data.dt * length)
        if abs(velocity) > limit:
            kept = kept and abs(velocity) <= (1.0 + KEPT) * limit
            velocity = math.copysign(limit, velocity)
        if limited and abs(velocity - before[j]) > changes[j]:
            kept = kept and abs(velocity - before[j]) <= (1.0 + KEPT) * changes[j]
            velocity = before[j] + math.copysign(changes[j], velocity - before[j])
        qdot[j] = velocity
    return kept
