"""Kernel: one control period of a receding horizon, row by row."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy_kernels import REFUSED, all_finite, answer_parts, as_rows, cut_rows
from baselines.solvers.arm_task import arm_task_of, joint_limits_of, period_of
from baselines.solvers.receding_horizon.newton.grid import cut, empty_grid, first_knots
from baselines.solvers.receding_horizon.newton.minimise import CONVERGED, NewtonSettings, minimise
from baselines.solvers.receding_horizon.newton.plan import (
    Plan,
    PlanSettings,
    branch_off,
    first_part,
    improve_candidate,
    initial_plan,
    plan_workspace,
    shift_plan,
    try_start,
)
from baselines.solvers.receding_horizon.newton.workspace import PathProblem
from baselines.solvers.receding_horizon.problem_data import ProblemData
from baselines.status import Status
from ikgym.cost_kernels import CostParameters
from ikgym.jit import inlined, kernel
from ikgym.kinematics import Chain

_CONVERGED, _LIMIT, _SATURATED = int(Status.CONVERGED), int(Status.ITERATION_LIMIT), int(Status.SATURATED)

# How exactly a plan keeps the velocity limit, as a share of it.
KEPT = 1e-5
# Newton steps of the initial plan at least, and of a plan that is to be brought to its optimum.
STEPS_OF_THE_FIRST, STEPS_TO_THE_OPTIMUM = 30, 300
# Behind so many periods beyond the velocity limits another plan is begun beside it.
RETRY = 4


class HorizonMemory(NamedTuple):
    """What a receding horizon remembers of each of B arms.

    Attributes:
        plan: Joint coordinates at the knots in [rad] or [m]. Shape (B, K, n).
        multipliers: λ of the plan's kinks and limits. Shape (B, K, e + 2 n).
        candidate: The restart candidate, likewise. Shape (B, K or 0, n).
        candidate_multipliers: Likewise. Shape (B, K or 0, e + 2 n).
        periods: Periods planned so far. Shape (B,).
        candidate_steps: Newton steps that the candidates have had. Shape (B,).
        tried: Initial guesses tried so far. Shape (B,).
        far: How many periods in a row have ended beyond the velocity limits. Shape (B,).
    """

    plan: npt.NDArray[np.float64]
    multipliers: npt.NDArray[np.float64]
    candidate: npt.NDArray[np.float64]
    candidate_multipliers: npt.NDArray[np.float64]
    periods: npt.NDArray[np.int64]
    candidate_steps: npt.NDArray[np.int64]
    tried: npt.NDArray[np.int64]
    far: npt.NDArray[np.int64]


@kernel
def plan_rows(  # the first arguments are described where they come from
    arm_task,
    prismatic,
    delta_x,
    p_x,
    delta_qdot,
    p_out,
    p_in,
    at,
    terminal_weight,
    stop_at_end,
    max_steps,
    tolerance,
    starts,
    restart_steps,
    restart_rate,
    seed,
    start_steps,
    recovery_steps,
    rate_weight,
    checking,
    q,
    qdot_before,
    pose,
    nominal,
    remaining,
    plans,
    multipliers,
    candidates,
    candidate_multipliers,
    periods,
    candidate_steps,
    tried,
    far,
    action,
    answer,
):
    """Plans one period for each of B arms.

    Flat arguments, since this is entered at each `predict`: numba unpacks them in 2.5 µs, and the same as five named
    tuples in 11 µs, which is half of what a `predict` with a horizon of 3 takes in all.

    The arguments are arm and task (see :func:`plain_arm_task`), which joints are prismatic, those of
    :class:`CostParameters` and :class:`PlanSettings`, then those of :class:`CompiledPolicy` with the memory of
    :class:`HorizonMemory`, its plans and candidates in the plural. The iterations are the Newton steps made, those of
    initial guesses and candidates among them.
    """
    if checking and not all_finite(q, qdot_before, pose, nominal, remaining):
        return REFUSED
    (dt, action_scale), (lower, upper, velocity_limit) = period_of(arm_task), joint_limits_of(arm_task)
    n, knots = action_scale.shape[0], at.shape[0]
    q, pose, nominal = as_rows(n, q, pose, nominal)
    qdot, status, iterations = answer_parts(answer, q.shape[0], n)
    (offsets, axes, _, tool, tool_rotation), kind = arm_task_of(arm_task)
    chain = Chain(offsets, axes, prismatic, tool, tool_rotation)  # read-only, as others have compiled for
    cost = CostParameters(delta_x, p_x, delta_qdot, p_out, p_in)
    data = ProblemData(chain, kind, cost, dt, lower, upper, velocity_limit)
    settings = PlanSettings(
        at,
        terminal_weight,
        stop_at_end,
        max_steps,
        tolerance,
        starts,
        restart_steps,
        restart_rate,
        seed,
        start_steps,
        recovery_steps,
        rate_weight,
    )
    workspace = plan_workspace(kind, nominal.shape[2], knots, n, multipliers.shape[2])
    new_grid, old_grid = empty_grid(knots), empty_grid(knots)
    for row in range(q.shape[0]):
        left = int(min(max(remaining[row], 1.0), at[-1] + 1.0)) if stop_at_end else at[-1]
        grid = first_knots(new_grid, cut(at, left, terminal_weight, new_grid))
        old = first_knots(old_grid, cut(at, left + 1 if stop_at_end else left, terminal_weight, old_grid))
        before, unlimited = qdot_before[row * n : (row + 1) * n], velocity_limit[:0]
        problem = PathProblem(data, grid, q[row], nominal[row], before, rate_weight, unlimited, False)
        for j in range(n):
            workspace.passed[j] = qdot_before[row * n + j] * dt
        plan = Plan(plans[row], multipliers[row])
        starting = start_steps > 0 and periods[row] > 0 and tried[row] + 1 < starts
        retried = far[row] > 0 and far[row] % RETRY == 0
        hurried = far[row] > 0 and not (starting or retried or max_steps < 0)
        steps = max(recovery_steps, max_steps) if hurried else max_steps
        minimum, made = _plan(problem, settings, steps, periods[row], old, plan, workspace)
        value, age = minimum.cost, candidate_steps[row : row + 1]
        plan = first_part(plan, grid.at.shape[0])
        if far[row] > 0 and not starting:
            age[0] = 0  # no time for the candidate, which is left behind
            if retried:
                number = starts + periods[row]
                made += try_start(problem, settings, recovery_steps, plan, value, number, workspace)
        elif restart_steps > 0 and periods[row] > 0:
            candidate = Plan(candidates[row], candidate_multipliers[row])
            if age[0] == 0:
                branch_off(problem, settings, plan, starting, starts + periods[row], candidate, workspace)
            else:
                shift_plan(old, candidate, grid, workspace)
            candidate = first_part(candidate, grid.at.shape[0])
            rate = start_steps if starting else restart_rate
            tried[row] += starting
            made += improve_candidate(problem, settings, rate, plan, value, candidate, age, workspace)
        periods[row] += 1
        kept = _first_velocity(data, q[row], plans[row, 0], grid.length[0], qdot[row])
        status[row] = (_CONVERGED if minimum.outcome == CONVERGED else _LIMIT) if kept else _SATURATED
        far[row] = 0 if kept or recovery_steps == 0 else far[row] + 1
        iterations[row] = made
    return cut_rows(qdot, action_scale, action.reshape(qdot.shape), status)


@inlined
def _plan(problem, settings, most, period, old_grid, plan, workspace):
    """Plans a period of one arm, from the plan of the period before or from an initial guess.

    Args:
        problem: A :class:`PathProblem`.
        settings: :class:`PlanSettings`.
        most: Newton steps in this period; -1 to the optimum.
        period: Periods planned before.
        old_grid: The grid of the plan before.
        plan: The :class:`Plan`, changed in place.
        workspace: A :class:`plan.PlanWorkspace`.

    Returns:
        The :class:`minimise.Minimum`, and Newton steps made, those of initial guesses among them.
    """
    part = first_part(plan, problem.grid.at.shape[0])
    made, exact, steps = 0, most < 0, most
    if period == 0:
        made = initial_plan(problem, settings, part, workspace)
        steps = max(settings.start_steps if settings.start_steps > 0 else STEPS_OF_THE_FIRST, steps)
    else:
        shift_plan(old_grid, plan, problem.grid, workspace)
    if exact:
        steps = STEPS_TO_THE_OPTIMUM
    newton = NewtonSettings(exact, steps, settings.tolerance)
    minimum = minimise(problem, part.path, part.multipliers, newton, workspace.newton)
    return minimum, made + minimum.steps


@inlined
def _first_velocity(data, q, target, length, qdot):
    """The joint velocities of a plan's first block, within all limits.

    Args:
        data: The :class:`ProblemData`.
        q: Joint coordinates now, in [rad] or [m]. Shape (n,).
        target: Joint coordinates at the first knot, in [rad] or [m]. Shape (n,).
        length: Steps of the block.
        qdot: Receives the joint velocities, in [rad/s] or [m/s]. Shape (n,).

    Returns:
        Whether the plan keeps the velocity limit.
    """
    kept = True
    for j in range(q.shape[0]):
        # A limit that holds the plan is kept to the tolerance only; what is no number stays none.
        here, limit = target[j], data.velocity_limit[j]
        if here < data.lower[j]:
            here = data.lower[j]
        elif here > data.upper[j]:
            here = data.upper[j]
        velocity = (here - q[j]) / (data.dt * length)
        if abs(velocity) > limit:
            kept = kept and abs(velocity) <= (1.0 + KEPT) * limit
            velocity = math.copysign(limit, velocity)
        qdot[j] = velocity
    return kept
