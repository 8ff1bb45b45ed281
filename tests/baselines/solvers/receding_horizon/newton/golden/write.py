"""Writes `horizons.json`: optima of horizons of the Panda within the limits of its joints, by IPOPT.

    python -m tests.baselines.solvers.receding_horizon.newton.golden.write    # needs CasADi

A line a state: joint coordinates, joint velocities and the nominal path (see `states.State`), the cost of the plan that
IPOPT finds from rest at the start, and how many positions, velocities and accelerations of that plan are at a limit.
States at which IPOPT finds no optimum are left out, and counted at the end.
"""

import json
from pathlib import Path

import numpy as np

from tests.baselines.solvers.receding_horizon.newton.states import (
    DT,
    KNOTS,
    draw,
    horizon_of,
    problem_of,
)
from tests.independent.casadi_horizon import CasadiHorizon
from tests.independent.numpy_horizon import Horizon

FILE = Path(__file__).parent / "horizons.json"
STATES, SEED = 50, 2026
#: What is as near to a limit as this share of it is at the limit.
NEAR = 1e-6


def at_limits(problem, horizon: Horizon, q: np.ndarray) -> list[int]:
    """How many positions, velocities and accelerations of a plan are at a limit."""
    arm = problem.model
    qdot = np.diff(np.vstack([horizon.q, q]), axis=0) / DT
    qddot = np.diff(np.vstack([horizon.qdot, qdot]), axis=0) / DT
    q = np.vstack([q, q[-1] + qdot[-1] * np.abs(qdot[-1]) / (2.0 * arm.acceleration_limit)])
    positions = np.minimum(arm.upper - q, q - arm.lower) < NEAR
    velocities = np.abs(qdot) > (1.0 - NEAR) * arm.velocity_limit
    accelerations = np.abs(qddot) > (1.0 - NEAR) * arm.acceleration_limit
    return [int(held.sum()) for held in (positions, velocities, accelerations)]


if __name__ == "__main__":
    problem, rng, lines, lost = problem_of(), np.random.default_rng(SEED), [], 0
    solver = CasadiHorizon(problem, KNOTS, limited=True, braking=True)
    while len(lines) < STATES:
        state = draw(rng)
        horizon = horizon_of(problem, state)
        plan = solver.solve(horizon)
        if not plan.converged:
            lost += 1
            continue
        numbers = {"q": state.q.tolist(), "qdot": state.qdot.tolist(), "path": state.path.tolist()}
        lines.append(json.dumps(numbers | {"cost": plan.cost, "at_limit": at_limits(problem, horizon, plan.q)}))
    FILE.write_text("[\n" + ",\n".join(lines) + "\n]\n", encoding="utf-8")
    print(f"{STATES} states, {lost} left out.")
