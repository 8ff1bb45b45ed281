"""Kernel: one control period of a receding horizon, row by row."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.solvers.receding_horizon.newton.cost import Rules, true_cost
from baselines.solvers.receding_horizon.newton.grid import cut, empty_grid, first_knots, slide, slide_multipliers
from baselines.solvers.receding_horizon.newton.guess import DAMPING, STREAM, draw, roll_out, uniform
from baselines.solvers.receding_horizon.newton.minimise import CONVERGED, Room, minimise, room_for
from baselines.status import Status
from ikgym.cost_kernels import CostParameters
from ikgym.jit import kernel
from ikgym.kinematics import Chain

_CONVERGED, _LIMIT, _SATURATED = int(Status.CONVERGED), int(Status.ITERATION_LIMIT), int(Status.SATURATED)

# How exactly a plan keeps the velocity limit, as a share of it.
KEPT = 1e-5

# Newton steps of each of several first plans, of a single one, and of a plan that is to be brought to its optimum.
STEPS_OF_A_START, STEPS_OF_THE_FIRST, STEPS_TO_THE_OPTIMUM = 30, 30, 300
# How exactly the first plans are minimised before they are compared.
TOLERANCE_OF_A_START = 1e-4
# A challenger that is still so many times dearer than the plan after so many Newton steps is given up.
HOPELESS, TRIED = 10.0, 5
# The plan gives way to a challenger only for a gain that is worth the jump.
GAIN = 1e-3


class Settings(NamedTuple):
    """What the parameters of :class:`baselines.solvers.receding_horizon.rhc.RecedingHorizon` say to the kernel.

    Attributes:
        at: Steps from now to the knots. Shape (K,).
        terminal_weight: Factor of the tracking cost of the last knot.
        stop_at_end: Whether the horizon ends with the episode.
        iterations: Newton steps in one period; -1 to the optimum.
        tolerance: Relative precision of the optimum.
        starts: First plans to choose from.
        challenge: Newton steps of a challenger, 0 for none.
        challenge_rate: Of them in one period.
        seed: Of the random guesses.
    """

    at: npt.NDArray[np.int64]
    terminal_weight: float
    stop_at_end: bool
    iterations: int
    tolerance: float
    starts: int
    challenge: int
    challenge_rate: int
    seed: int


class Desk(NamedTuple):
    """Arrays that the rows of a call use one after the other."""

    room: Room
    path: npt.NDArray[np.float64]
    multipliers: npt.NDArray[np.float64]
    gram: npt.NDArray[np.float64]
    x: npt.NDArray[np.float64]
    drift: npt.NDArray[np.float64]
    passed: npt.NDArray[np.float64]


@kernel
def plan_rows(  # noqa: D417  # the first arguments are described where they come from
    offsets,
    axes,
    prismatic,
    tool,
    tool_rotation,
    kind,
    delta_x,
    p_x,
    delta_qdot,
    p_out,
    p_in,
    dt,
    lower,
    upper,
    velocity_limit,
    at,
    terminal_weight,
    stop_at_end,
    most,
    tolerance,
    starts,
    challenge,
    challenge_rate,
    seed,
    q,
    qdot_before,
    nominal,
    remaining,
    paths,
    multipliers,
    rivals,
    rival_multipliers,
    calls,
    ages,
    qdot,
    status,
    iterations,
):
    """Plans one period for each of B arms; tuples are taken apart by the caller, see :func:`ikgym.simulation.step`.

    The arguments are those of a :class:`Rules` and of :class:`Settings`, then

    Args:
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        qdot_before: Joint velocities last applied. Shape (B, n).
        nominal: Nominal task coordinates ahead. Shape (B, at least at[-1], m).
        remaining: Steps left. Shape (B, 1).
        paths: The plans, joint coordinates at the knots; changed in place. Shape (B, K, n).
        multipliers: Of their kinks and limits. Shape (B, K, e + 2 n).
        rivals: The challengers, likewise. Shape (B, K or 0, n).
        rival_multipliers: Likewise. Shape (B, K or 0, e + 2 n).
        calls: Periods planned so far. Shape (B,).
        ages: Newton steps that the challengers have had. Shape (B,).
        qdot: Receives the joint velocities. Shape (B, n).
        status: Receives values of :class:`Status`. Shape (B,).
        iterations: Receives the Newton steps made, those of first plans and challengers among them. Shape (B,).
    """
    rules = Rules(
        Chain(offsets, axes, prismatic, tool, tool_rotation),
        kind,
        CostParameters(delta_x, p_x, delta_qdot, p_out, p_in),
        dt,
        lower,
        upper,
        velocity_limit,
    )
    settings = Settings(at, terminal_weight, stop_at_end, most, tolerance, starts, challenge, challenge_rate, seed)
    n, knots, wide = q.shape[1], at.shape[0], multipliers.shape[2]
    e = wide - 2 * n
    desk = Desk(
        room_for(kind, nominal.shape[2], knots, n),
        np.empty((knots, n)),
        np.empty((knots, wide)),
        np.empty((e, e)),
        np.empty(e),
        np.empty(n),
        np.empty(n),
    )
    new_grid, old_grid = empty_grid(knots), empty_grid(knots)
    for row in range(q.shape[0]):
        left = int(min(max(remaining[row, 0], 1.0), at[-1] + 1.0)) if stop_at_end else at[-1]
        grid = first_knots(new_grid, cut(at, left, terminal_weight, new_grid))
        here = grid.at.shape[0]
        path, held = paths[row, :here], multipliers[row, :here]
        if calls[row] == 0:
            made = _first_plan(rules, settings, grid, q[row], nominal[row], path, held, desk)
            budget = max(STEPS_OF_THE_FIRST, settings.iterations)
        else:
            made = 0
            budget = settings.iterations
            old = first_knots(old_grid, cut(at, left + 1 if stop_at_end else left, terminal_weight, old_grid))
            for j in range(n):
                desk.passed[j] = qdot_before[row, j] * dt
            _slide(old, paths[row], multipliers[row], grid, desk)
        outcome, steps, value, _ = minimise(
            rules,
            grid,
            q[row],
            nominal[row],
            path,
            held,
            settings.iterations < 0,
            STEPS_TO_THE_OPTIMUM if settings.iterations < 0 else budget,
            tolerance,
            desk.room,
        )
        made += steps
        if challenge > 0 and calls[row] > 0:
            made += _challenge(
                rules,
                settings,
                old,
                grid,
                q[row],
                nominal[row],
                path,
                held,
                value,
                rivals[row],
                rival_multipliers[row],
                calls[row],
                ages[row : row + 1],
                desk,
            )
        calls[row] += 1
        status[row] = _CONVERGED if outcome == CONVERGED else _LIMIT
        for j in range(n):
            # A limit that holds the plan is kept to the tolerance only; what is no number stays none.
            target, limit = path[0, j], velocity_limit[j]
            if target < lower[j]:
                target = lower[j]
            elif target > upper[j]:
                target = upper[j]
            velocity = (target - q[row, j]) / (dt * grid.length[0])
            if abs(velocity) > limit:
                if abs(velocity) > (1.0 + KEPT) * limit:
                    status[row] = _SATURATED
                velocity = math.copysign(limit, velocity)
            qdot[row, j] = velocity
        iterations[row] = made


@kernel
def _slide(old, path, multipliers, grid, desk):
    """Turns plan and multipliers into what is left of them one step later."""
    slide(old, path, desk.passed, grid, desk.path)
    slide_multipliers(old, multipliers, grid)
    for k in range(grid.at.shape[0]):
        for j in range(path.shape[1]):
            path[k, j] = desk.path[k, j]


@kernel
def _first_plan(rules, settings, grid, start, nominal, path, held, desk):
    """The first plan of an episode: the cheapest of several roll-outs, each a few Newton steps on; the steps made."""
    made, best = 0, np.inf
    knots = path.shape[0]
    for trial in range(settings.starts):
        damping = DAMPING
        desk.drift[:] = 0.0
        if trial > 0:
            damping = draw(settings.seed, trial, desk.drift)
        roll_out(rules, grid, start, nominal, 0, desk.drift, damping, path, desk.room.scratch, desk.gram, desk.x)
        held[:] = 0.0
        if settings.starts == 1:
            return 0
        _, steps, value, _ = minimise(
            rules, grid, start, nominal, path, held, False, STEPS_OF_A_START, TOLERANCE_OF_A_START, desk.room
        )
        made += steps
        value = max(value, true_cost(rules, grid, start, nominal, path, desk.room.scratch))
        if value < best:
            best = value
            desk.path[:knots] = path
            desk.multipliers[:knots] = held
    if best < np.inf:
        path[:] = desk.path[:knots]
        held[:] = desk.multipliers[:knots]
    return made


@kernel
def _challenge(rules, settings, old, grid, start, nominal, path, held, value, rival, rival_held, call, age, desk):
    """Improves the challenger, which branches off the plan at a random knot, and takes it over where it is cheaper.

    Returns:
        Newton steps made.
    """
    knots = path.shape[0]
    if age[0] == 0:
        number = settings.starts + call
        branch = int(uniform(settings.seed, STREAM * number) * knots)
        rival[:branch] = path[:branch]
        rival_held[:branch] = held[:branch]
        rival_held[branch:] = 0.0
        damping = draw(settings.seed, number, desk.drift)
        roll_out(
            rules,
            grid,
            start,
            nominal,
            branch,
            desk.drift,
            damping,
            rival[:knots],
            desk.room.scratch,
            desk.gram,
            desk.x,
        )
    else:
        _slide(old, rival, rival_held, grid, desk)
    _, steps, reached, _ = minimise(
        rules,
        grid,
        start,
        nominal,
        rival[:knots],
        rival_held[:knots],
        False,
        settings.challenge_rate,
        settings.tolerance,
        desk.room,
    )
    age[0] += settings.challenge_rate
    if age[0] >= settings.challenge:
        age[0] = 0
        true = true_cost(rules, grid, start, nominal, rival[:knots], desk.room.scratch)
        if max(reached, true) < (1.0 - GAIN) * value:
            path[:] = rival[:knots]
            held[:] = rival_held[:knots]
    elif age[0] >= TRIED and not reached < HOPELESS * value:
        age[0] = 0
    return steps
