"""The receding horizon beside gradient descent, IPOPT and Crocoddyl: time of a solve, and the cost that it reaches."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

import baselines
import ikgym
from benchmarks.horizon_solvers import EXACT, Observation, policies, rivals
from benchmarks.measuring import FULL, Effort, medians
from benchmarks.table import Table
from ikgym.scenarios import Scenario

SCENARIOS = ("varga7-fast", "varga7-slow")
CONDITIONS = (
    "At {states} states of an episode of rhc, one arm, one thread. Each solver starts from its own plan of the step "
    "before, after {lead} such steps; solve is the median over the states, slowest the slowest of them, each the "
    "median of {solves} interleaved calls. Iterations, converged (the share of states at which the solver reports "
    "convergence) and cost are means; excess is the fraction by which the cost is above the lowest of all solvers at "
    "that state, median and worst. rhc_gradient makes 450 steps, the paper's limit, or fewer if it diverges. IPOPT's "
    "barrier leaves about 1e-9 of cost, a large fraction of a tiny one. Crocoddyl calls a compiled cost through "
    "Python, its only interface for this one."
)
COLUMNS = (*("solve [µs]", "slowest [µs]", f"× {EXACT}", "iterations", "converged", "cost", "excess", "worst excess"),)


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
    return Table(f"A horizon of {grid} grid points in {name}", conditions, COLUMNS, rows, skipped)


def along(scenario: Scenario, preview: int, count: int, lead: int) -> list[list[Observation]]:
    """States of an episode of a receding horizon, evenly spread, each at the end of the steps that lead to it.

    The episode is one of `rhc` with the same horizon, since its solver has to be fast where it leads.

    Args:
        scenario: The scenario.
        preview: Steps of the nominal trajectory that the observations show.
        count: The number of states.
        lead: Steps shown before each of them.

    Returns:
        For each state, the ``lead + 1`` observations up to it.
    """
    policy = baselines.make("rhc", scenario, horizon=preview + 1)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=preview)
    observation, _ = env.reset(seed=0)
    ends = np.linspace(0, scenario.steps, count + 2).astype(int)[1:-1]
    episode, state = [], None
    for _ in range(int(ends[-1]) + 1):
        episode.append({key: np.array(value) for key, value in observation.items()})
        action, state = policy.predict(observation, state)
        observation, *_ = env.step(action)
    return [episode[max(end - lead, 0) : end + 1] for end in ends]
