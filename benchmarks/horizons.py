"""The receding horizon beside gradient descent, IPOPT and Crocoddyl: time of a solve, and the cost that it reaches."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from typing import Any

import ikgym
from benchmarks.effort import FULL, Effort
from benchmarks.horizon_solvers import EXACT, linear_quadratic, policies, rivals
from benchmarks.states import along
from benchmarks.table import Column, Table
from benchmarks.timing import medians

SCENARIOS = ("varga7-fast", "varga7-slow")
CONDITIONS = (
    "At {states} states of an episode of damped least squares, one arm, one thread. Everyone starts from its own plan "
    "of the step before, after {lead} such steps; solve is the median over the states, slowest the slowest of them, "
    "each the median of {solves} interleaved calls. Iterations, the share of states where the solver says that it has "
    "converged, and the cost are means; excess is by what fraction the cost is above the lowest that any of them "
    "reaches at that state, median and worst. rhc_gradient makes 450 steps, the paper's limit, and fewer only where it "
    "diverges. IPOPT's barrier leaves about 1e-9 of cost, which is a large fraction of a tiny one. Crocoddyl calls a "
    "compiled cost through Python, its only interface for this one; its LQR is one iteration of another problem of the "
    "same size, quadratic, without kinematics and wholly in C++: a bound for its iterations."
)
#: Another problem, with a time and no cost.
BOUND = "Crocoddyl, LQR"
COLUMNS = (
    Column("solve_us", "solve", "µs"),
    Column("slowest_us", "slowest", "µs"),
    Column("ratio", f"× {EXACT}"),
    Column("iterations", "iterations"),
    Column("converged", "converged"),
    Column("cost", "cost"),
    Column("excess", "excess"),
    Column("worst_excess", "worst excess"),
)


def tables(effort: Effort = FULL) -> list[Table]:
    """One table per scenario and horizon."""
    first, *others = ((scenario, grid) for scenario in SCENARIOS for grid in effort.grids)
    conditions = CONDITIONS.format(states=effort.states, lead=effort.lead, solves=effort.solves)
    return [
        _table(*first, effort, conditions),
        *(
            _table(*case, effort, "States, columns and conditions as in the first table of horizons.")
            for case in others
        ),
    ]


def _table(name: str, grid: int, effort: Effort, conditions: str) -> Table:
    scenario = ikgym.scenarios.get(name)
    states = along(scenario, grid - 1, effort.states, effort.lead)
    others, skipped = rivals(scenario, grid)
    warmed = {
        (label, i): solver.warmed(state)
        for label, solver in (policies(scenario, grid) | others).items()
        for i, state in enumerate(states)
    }
    calls: dict[tuple[str, int], Callable[[], Any]] = {key: call for key, (call, _) in warmed.items()}
    bound = linear_quadratic(scenario.joints, grid - 1)
    if bound is not None:
        calls[BOUND, 0] = bound
    answers = {key: answer(call()) for key, (call, answer) in warmed.items()}
    # One call a turn: the slow ones would take minutes otherwise, and the fast ones have as many turns.
    times = medians(calls, effort.solves, 0.0)
    labels = list(dict.fromkeys(label for label, _ in warmed))
    best = [min(answers[label, i].cost for label in labels) for i in range(len(states))]
    rows: dict[str, tuple[float | None, ...]] = {}
    reference = None
    for label in labels:
        spent = [times[label, i] for i in range(len(states))]
        reached = [answers[label, i] for i in range(len(states))]
        excess = [answer.cost / lowest - 1.0 for answer, lowest in zip(reached, best, strict=True)]
        middle = statistics.median(spent)
        reference = middle if label == EXACT else reference
        rows[label] = (
            1e6 * middle,
            1e6 * max(spent),
            None if reference is None else middle / reference,
            statistics.fmean(answer.iterations for answer in reached),
            statistics.fmean(answer.converged for answer in reached),
            statistics.fmean(answer.cost for answer in reached),
            statistics.median(excess),
            max(excess),
        )
    if bound is not None:
        spent_us = 1e6 * times[BOUND, 0]
        share = None if reference is None else times[BOUND, 0] / reference
        rows[BOUND] = (spent_us, spent_us, share, 1.0, None, None, None, None)
    return Table(
        f"horizon_{name}_{grid}",
        f"A horizon of {grid} grid points in {name}",
        conditions,
        COLUMNS,
        rows,
        skipped,
    )
