"""How the time of a solve grows: with the horizon, with the joints, with the arms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

import baselines
import ikgym
from baselines.policy import Memory, SolverPolicy
from benchmarks.effort import FULL, Effort
from benchmarks.states import Observation, along, chain, rows_along
from benchmarks.table import Column, Table
from benchmarks.timing import medians
from ikgym.scenarios import Scenario
from ikgym.trajectories import Sinusoid

Predict = Callable[[], tuple[Any, Memory]]
CONDITIONS = "Warm, as in an episode: one Newton step a call, and as many as it takes to converge; medians."


class Case(NamedTuple):
    """A problem of one size.

    Attributes:
        step: One Newton step.
        solve: The solve to convergence.
        parts: How many parts the problem has, of those it is made to grow by.
    """

    step: Predict
    solve: Predict
    parts: int


def tables(effort: Effort = FULL) -> list[Table]:
    """Growth with the horizon, with the joints, and with the rows of a batch."""
    slow, random = (ikgym.scenarios.get(name) for name in ("varga7-slow", "varga7-random"))
    grid, lead = effort.grid, effort.lead
    by_horizon = {
        f"HL = {long}": _case(slow, long, along(slow, long - 1, 1, lead)[0], long - 1) for long in effort.growth
    }
    chains = {n: _swinging(n) for n in effort.joints}
    by_joints = {f"n = {n}": _case(s, grid, along(s, grid - 1, 1, lead)[0], n) for n, s in chains.items()}
    by_rows = {f"B = {b:,}": _case(random, grid, rows_along(random, grid - 1, b, lead), b) for b in effort.batches}
    links = f"Chains of n links of 0.3 m, task skew, sinusoids in all joints, HL = {grid}."
    arms = f"varga7-random, HL = {grid}, each arm on its own trajectory, one predict for all of them."
    return [
        _table("growth_horizon", "Growth with the horizon", "varga7-slow.", "knot", by_horizon, effort),
        _table("growth_joints", "Growth with the joints", links, "joint", by_joints, effort),
        _table("growth_batch", "Growth with the arms", arms, "arm", by_rows, effort),
    ]


def _table(key: str, title: str, conditions: str, part: str, cases: dict[str, Case], effort: Effort) -> Table:
    calls = {(name, call): getattr(case, call) for name, case in cases.items() for call in ("step", "solve")}
    times = {name: 1e6 * t for name, t in medians(calls, effort.rounds, min(effort.seconds, 0.02)).items()}
    rows: dict[str, tuple[float | None, ...]] = {}
    for name, case in cases.items():
        step, solve = times[name, "step"], times[name, "solve"]
        iterations = float(np.mean(SolverPolicy.report(case.solve()[1]).iterations))
        rows[name] = step, step / case.parts, solve, solve / case.parts, iterations
    columns = (
        Column("step_us", "one Newton step", "µs"),
        Column("step_part_us", f"per {part}", "µs"),
        Column("solve_us", "to convergence", "µs"),
        Column("solve_part_us", f"per {part}", "µs"),
        Column("iterations", "iterations"),
    )
    return Table(key, title, f"{CONDITIONS} {conditions}", columns, rows)


def _case(scenario: Scenario, grid: int, states: Sequence[Observation], parts: int) -> Case:
    step, solve = (
        baselines.make("rhc", scenario, horizon=grid, iterations=1),
        baselines.make("rhc", scenario, horizon=grid),
    )
    return Case(_warm(step, states), _warm(solve, states), parts)


def _warm(policy: SolverPolicy, states: Sequence[Observation]) -> Predict:
    """The call for the last of the states, with the memory of those before."""
    memory = None
    for observation in states[:-1]:
        _, memory = policy.predict(observation, memory)
    return lambda: policy.predict(states[-1], memory)


def _swinging(joints: int) -> Scenario:
    """A chain that swings in all joints, at most at 1 rad/s."""
    trajectory = Sinusoid(np.full(joints, 0.5), np.linspace(1.0, 2.0, joints))
    skew = ikgym.tasks.get("skew")
    return Scenario(f"chain{joints}", chain(joints), skew, trajectory, velocity_limit=np.full(joints, 20.0))
