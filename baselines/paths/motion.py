"""Joint motions along the path of a scenario, from several starts at once."""

from __future__ import annotations

import dataclasses

import numpy as np
from gymnasium.utils import seeding

from baselines import registry
from ikgym.cost import TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.outcome import observation
from ikgym.plant import Plant
from ikgym.scenarios import Scenario
from ikgym.scenarios.durations import duration
from ikgym.simulator import Simulator
from ikgym.validation import FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class Motion:
    """Motions of `qp` along a path, from N starts and within all limits of the arm.

    Args:
        times: From the start on, in [s]. Shape (k + 1,).
        q: Joint coordinates in [rad] or [m]. Shape (k + 1, N, n).
        position_error: In [m]. Shape (k, N).
        orientation_error: In [rad]; 0 where the task has no orientation. Shape (k, N).
        held_back: Joints that the limits of the arm held back in each step. Shape (k, N).
    """

    times: FloatArray
    q: FloatArray
    position_error: FloatArray
    orientation_error: FloatArray
    held_back: FloatArray

    def of(self, row: int) -> Motion:
        """The motion from one of the starts."""
        errors = (x[:, row : row + 1] for x in (self.position_error, self.orientation_error, self.held_back))
        return Motion(self.times, self.q[:, row : row + 1], *errors)


def path_duration(scenario: Scenario) -> float:
    """The time that the path takes, or the episode where the path goes on for ever, in [s].

    Raises:
        InvalidInputError: The path differs from reset to reset.
    """
    if scenario.random:
        raise InvalidInputError(f"Expected a path that is the same at every reset, got scenario {scenario.name!r}.")
    ends = duration(scenario.trajectory)
    return float(scenario.steps * scenario.dt if ends is None else ends)


def ideal(scenario: Scenario, **changes: object) -> Scenario:
    """The scenario on an arm as in the data sheet, over its whole path."""
    dt = changes.get("dt", scenario.dt)
    steps = int(np.ceil(path_duration(scenario.replace(**changes)) / dt - 1e-9))  # type: ignore[operator]
    usual = {"plant": Plant(), "initial_pose": None, "iterations_per_point": 1, "cost": TrackingCost()}
    return scenario.replace(**{"model": scenario.arm, **usual, "steps": max(steps, 2), **changes})


def played(scenario: Scenario, starts: FloatArray) -> Motion:
    """`qp` on a scenario.

    Args:
        scenario: A result of :func:`ideal`.
        starts: Joint coordinates in [rad] or [m]. Shape (N, n).
    """
    policy, rows = registry.make("qp", scenario), len(starts)
    simulator = Simulator(scenario, rows, policy.preview)
    simulator.reset(np.ones(rows, dtype=np.bool_), [seeding.np_random(0)[0]] * rows, starts)
    out, state = simulator.observe(), None
    q, errors = [out.true_q], []
    for _ in range(scenario.steps):
        action, state = policy.predict(observation(out), state)
        out = simulator.step(action)
        q.append(out.true_q)
        errors.append((out.position_error, out.orientation_error, out.at_limit))
    position, orientation, at_limit = (np.array(column) for column in zip(*errors, strict=True))
    times = scenario.dt * np.arange(scenario.steps + 1, dtype=np.float64)
    return Motion(times, np.array(q), position, np.nan_to_num(orientation), at_limit.sum(axis=-1))
