"""The receding horizon beside gradient descent and IPOPT: time of a solve, and the cost that it reaches."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

import baselines
import ikgym
from baselines.policy import Problem, SolverPolicy
from baselines.solvers.receding_horizon.rhc import RecedingHorizon
from benchmarks.measuring import FULL, Effort, medians
from benchmarks.rivals.casadi_horizon import CasadiHorizon
from benchmarks.rivals.numpy_horizon import Horizon, plan_cost
from benchmarks.table import Table
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

SCENARIO = "varga7-fast"
#: The exact solver, to which all times are compared, and IPOPT through CasADi.
EXACT, IPOPT = "rhc", "CasADi, IPOPT"
#: Policies by label: name, parameters, and the longest horizon at which it does not take seconds.
POLICIES: dict[str, tuple[str, dict[str, Any], int]] = {
    EXACT: ("rhc", {}, 1000),
    "rhc, one Newton step a call": ("rhc", {"iterations": 1}, 1000),
    "rhc_gradient, analytic": ("rhc_gradient", {"gradient": "analytic", "tolerance": 0.0}, 1000),
    "rhc_gradient, differences": ("rhc_gradient", {"tolerance": 0.0}, 30),
}
CONDITIONS = (
    "At {states} states of an episode of rhc, one arm, one thread. Each solver starts from its own plan of the step "
    "before, after {lead} such steps; solve is the median over the states, each the median of {solves} interleaved "
    "calls. Excess is the fraction by which the cost is above the lowest of all solvers, median and worst. "
    "rhc_gradient makes 450 steps, the paper's limit, or fewer if it diverges."
)
COLUMNS = ("solve [µs]", f"× {EXACT}", "excess", "worst excess")
Observation = dict[str, FloatArray]


class Solve(NamedTuple):
    """A call that solves a state, to be timed, and the function that gives joint coordinates and cost of its result."""

    call: Callable[[], Any]
    plan: Callable[[Any], tuple[FloatArray, float]]


def tables(effort: Effort = FULL) -> list[Table]:
    """One table per horizon."""
    return [_table(ikgym.scenarios.get(SCENARIO), grid, effort) for grid in effort.grids]


def _table(scenario: Scenario, grid: int, effort: Effort) -> Table:
    states = along(scenario, grid - 1, effort.states, effort.lead)
    solves = [solvers(scenario, grid, state) for state in states]
    # One call a turn: the slow ones would take minutes otherwise, and the fast ones have as many turns.
    calls = {(label, i): one.call for i, some in enumerate(solves) for label, one in some.items()}
    costs = [{label: one.plan(one.call())[1] for label, one in some.items()} for some in solves]
    times = medians(calls, effort.solves, 0.0)
    reference = statistics.median(times[EXACT, i] for i in range(len(states)))
    rows: dict[str, tuple[float | None, ...]] = {}
    for label in solves[0]:
        spent = statistics.median(times[label, i] for i in range(len(states)))
        excess = [some[label] / min(some.values()) - 1.0 for some in costs]
        rows[label] = 1e6 * spent, spent / reference, statistics.median(excess), max(excess)
    conditions = CONDITIONS.format(states=effort.states, lead=effort.lead, solves=effort.solves)
    return Table(f"A horizon of {grid} grid points in {scenario.name}", conditions, COLUMNS, rows)


def solvers(scenario: Scenario, grid: int, observations: Sequence[Observation]) -> dict[str, Solve]:
    """The solvers of a horizon of HL grid points by label, at the last of some states; each has solved those before."""
    out = {
        label: _policy(baselines.make(name, scenario, horizon=grid, **parameters), observations)
        for label, (name, parameters, most) in POLICIES.items()
        if grid <= most
    }
    return {**out, IPOPT: _ipopt(CasadiHorizon(Problem.of(scenario), grid - 1), observations)}


def _policy(policy: SolverPolicy, observations: Sequence[Observation]) -> Solve:
    state, last = None, observations[-1]
    for observation in observations[:-1]:
        _, state = policy.predict(observation, state)

    def plan(result: Any) -> tuple[FloatArray, float]:
        q = plan_of(policy, last, result[1])
        return q, plan_cost(policy.problem, Horizon(last["q"], last["nominal"][: len(q)]), q)

    return Solve(lambda: policy.predict(last, state), plan)


def _ipopt(solver: CasadiHorizon, observations: Sequence[Observation]) -> Solve:
    """It starts from its last plan, shifted by a step."""
    start, horizons = None, [Horizon(o["q"], o["nominal"][: solver.knots]) for o in observations]
    for horizon in horizons[:-1]:
        q = solver.solve(horizon, start).q
        start = np.vstack([q[1:], q[-1:]])
    return Solve(lambda: solver.solve(horizons[-1], start), lambda plan: (plan.q, plan.cost))


def plan_of(policy: SolverPolicy, observation: Observation, state: Any) -> FloatArray:
    """The joint coordinates at the knots of a policy's plan. Shape (K, n)."""
    if isinstance(policy, RecedingHorizon):
        plan: FloatArray = policy.plan(state)[0]
        return plan
    qdot: FloatArray = state[2][0]  # those of gradient descent are velocities
    out: FloatArray = observation["q"] + policy.problem.dt * np.cumsum(qdot, axis=0)
    return out


def along(scenario: Scenario, preview: int, count: int, lead: int) -> list[list[Observation]]:
    """States of an episode of `rhc` with that horizon, evenly spread, each after ``lead`` others that lead to it."""
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
