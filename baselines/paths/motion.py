"""Joint motions along the path of a scenario, from several starts at once."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from baselines import registry
from baselines.registry import parse_policy
from baselines.solvers.quadratic_program.qp import QuadraticProgram
from baselines.solvers.resolved_rate.base import SLOW, velocity_weights
from ikgym.cost import TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.outcome import observation
from ikgym.plant import Plant
from ikgym.scenarios import Scenario
from ikgym.scenarios.scenario import duration
from ikgym.simulator import Simulator
from ikgym.trajectories import Trajectory
from ikgym.validation import FloatArray

#: The solver that surveys paths, and those that are tried where it does not follow closely.
PREFERRED, OTHERS = "qp", ("sns", "rhc_foresight")
#: Powers of the velocity limits that weigh slow joints heavier than `qp` does by default: the last one holds them.
HEAVIER = (1.6, 4.0)


@dataclasses.dataclass(frozen=True, eq=False)
class Motion:
    """Motions of a solver along a path, from N starts and within all limits of the arm."""

    times: FloatArray  # from the start on, in [s]. Shape (k + 1,)
    q: FloatArray  # joint coordinates in [rad] or [m]. Shape (k + 1, N, n)
    position_error: FloatArray  # in [m]. Shape (k, N)
    orientation_error: FloatArray  # in [rad]; 0 where the task has no orientation. Shape (k, N)
    held_back: FloatArray  # joints that the limits of the arm held back in each step. Shape (k, N)
    # smallest signed distance between bodies in [m], infinite where nothing can meet. Shape (k, N)
    clearance: FloatArray
    # the closest pair, and the one that touched at a stop; -1 where nothing can meet. Shape (k, N, 2)
    pair: npt.NDArray[np.int64]
    stopped: FloatArray  # 1 where bodies have touched and the arm is at rest. Shape (k, N)

    def of(self, row: int) -> Motion:
        """The motion from one of the starts."""
        columns = {name: values[:, row : row + 1] for name, values in vars(self).items() if name != "times"}
        return dataclasses.replace(self, **columns)


def path_duration(scenario: Scenario) -> float:
    """The time that the path takes, or the episode where the path has no end, in [s]."""
    if scenario.random:
        raise InvalidInputError(f"Expected a path that is the same at every reset, got scenario {scenario.name!r}.")
    ends = duration(scenario.trajectory)
    return float(scenario.steps * scenario.dt if ends is None else ends)


def ideal(scenario: Scenario, **changes: object) -> Scenario:
    """The scenario on an arm as in the data sheet, over its whole path."""
    dt = changes.get("dt", scenario.dt)
    steps = int(np.ceil(path_duration(scenario.replace(**changes)) / dt - 1e-9))  # type: ignore[operator]
    usual = {
        "plant": Plant(),
        "initial_pose": None,
        "iterations_per_point": 1,
        "cost": TrackingCost(),
        "proximity": None,
    }
    return scenario.replace(**{"model": scenario.arm, **usual, "steps": max(steps, 2), **changes})


def in_time(scenario: Scenario, timing: Callable[[Trajectory], Trajectory]) -> dict[str, Any]:
    """The path and the motions of the obstacles in another time, as changes of the scenario."""
    obstacles = (one if one.motion is None else one.replace(motion=timing(one.motion)) for one in scenario.obstacles)
    return {"trajectory": timing(scenario.trajectory), "obstacles": tuple(obstacles)}


def with_slow_joints_spared(scenario: Scenario) -> tuple[str, ...]:
    """`qp` with weights that spare slow joints, as texts for :func:`play_from`; none where no joint is slow."""
    weights = [np.ravel(velocity_weights(scenario.model, scenario.largest_qdot, power, SLOW)) for power in HEAVIER]
    rows = [row for row in weights if np.ptp(row) > 0.0]
    return tuple(f"{PREFERRED}:joint_weights=[{','.join(f'{one:.4g}' for one in row)}]" for row in rows)


def play_from(scenario: Scenario, starts: FloatArray, solver: str = PREFERRED) -> Motion:
    """A solver on a result of :func:`ideal` from starts (N, n) in [rad] or [m]; with collisions, these must be clear.

    A repulsion of `qp` that long control periods do not allow is as large as it may be.
    """
    (name, parameters), rate = parse_policy(solver), 1.0 / scenario.dt
    if name == PREFERRED and rate < QuadraticProgram.repulsion:
        parameters |= {"repulsion": rate}
    policy, rows = registry.make(name, scenario, **parameters), len(starts)
    simulator = Simulator(scenario, rows, policy.preview)
    simulator.reset(np.ones(rows, dtype=np.bool_), [seeding.np_random(0)[0]] * rows, starts)
    out, state = simulator.observe(), None
    q, errors, free = [out.true_q], [], (np.full(rows, np.inf), np.full((rows, 2), -1), np.zeros(rows))
    for _ in range(scenario.steps):
        action, state = policy.predict(observation(out), state)
        out = simulator.step(action)
        q.append(out.true_q)
        met = (out.clearance, out.pair, out.stopped) if scenario.collides else free
        errors.append((out.position_error, out.orientation_error, out.at_limit, *met))
    position, orientation, at_limit, clearance, pair, stopped = map(np.array, zip(*errors, strict=True))
    times = scenario.dt * np.arange(scenario.steps + 1, dtype=np.float64)
    held_back, met = at_limit.sum(axis=-1), (clearance, pair.astype(np.int64), stopped)
    return Motion(times, np.array(q), position, np.nan_to_num(orientation), held_back, *met)
