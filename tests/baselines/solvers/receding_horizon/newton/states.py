"""States of the Panda from which a horizon has to make up for an error within the limits of its joints."""

from typing import NamedTuple

import numpy as np

import ikgym
from baselines.policy import Problem
from baselines.solvers.receding_horizon.newton.interior_point import minimise_limited
from baselines.solvers.receding_horizon.newton.minimise import NewtonSettings
from baselines.solvers.receding_horizon.newton.workspace import PathProblem, newton_workspace
from ikgym.validation import read_only
from tests.baselines.solvers.receding_horizon.newton.problems import grid_of
from tests.independent.numpy_horizon import Horizon

#: Knots, one a step of 2 ms.
KNOTS = 29
DT = 2e-3


class State(NamedTuple):
    """Where the arm is, and the cubic that its nominal joint path follows.

    Attributes:
        q: Joint coordinates in [rad]. Shape (n,).
        qdot: Joint velocities in [rad/s]. Shape (n,).
        path: Position, velocity, acceleration and jerk of the nominal path now, in [rad], [rad/s], … Shape (4, n).
    """

    q: np.ndarray
    qdot: np.ndarray
    path: np.ndarray


def problem_of(arm="panda", task="pose") -> Problem:
    """Arm and task with the default cost."""
    arm = ikgym.arms.get(arm) if isinstance(arm, str) else arm
    return Problem(arm, ikgym.tasks.get(task), ikgym.TrackingCost(), DT, arm.velocity_limit)


def draw(rng: np.random.Generator) -> State:
    """A state off a nominal path that may leave all three limits, from which the arm can stop within its joints."""
    arm = problem_of().model
    while True:
        near = rng.random(7) < 0.2
        side = np.where(rng.random(7) < 0.5, arm.lower + 0.05, arm.upper - 0.05)
        position = np.where(near, side, rng.uniform(arm.lower, arm.upper))
        velocity = rng.random() * rng.uniform(-1.1, 1.1, 7) * arm.velocity_limit
        acceleration = rng.random() * rng.uniform(-1.3, 1.3, 7) * arm.acceleration_limit
        path = np.array([position, velocity, acceleration, 20.0 * rng.uniform(-1.0, 1.0, 7)])
        q = position + rng.choice([1e-4, 1e-3, 1e-2]) * rng.normal(size=7)
        qdot = np.clip(velocity + 0.1 * rng.normal(size=7), -arm.velocity_limit, arm.velocity_limit)
        end = q + qdot * np.abs(qdot) / (2.0 * arm.acceleration_limit)
        if (np.maximum(q, end) <= arm.upper).all() and (np.minimum(q, end) >= arm.lower).all():
            return State(q, qdot, path)


def horizon_of(problem: Problem, state: State, knots=KNOTS, at=None) -> Horizon:
    """The horizon of a state, with a knot at each step, or at some of them."""
    grid = grid_of(range(1, knots + 1) if at is None else at)
    t = DT * grid.at[:, None]
    joints = state.path[0] + t * (state.path[1] + t * (state.path[2] / 2.0 + t * state.path[3] / 6.0))
    nominal = problem.task.coordinates(*problem.model.forward(joints))
    return Horizon(state.q, nominal, grid.length, grid.tracking, state.qdot)


def path_problem(problem: Problem, horizon: Horizon, braking=True) -> PathProblem:
    """A horizon as the kernels see it."""
    arm, at = problem.model, np.cumsum(horizon.lengths).astype(int)
    # Read-only where a policy's is: kernels are compiled once for both.
    change = read_only(DT * arm.acceleration_limit)
    nominal = np.zeros((at[-1], problem.task.size))
    nominal[at - 1] = horizon.nominal
    q, before = np.array(horizon.q), np.array(horizon.qdot_before)
    weights = read_only(horizon.velocity_weights)
    return PathProblem(problem.kernel_model, grid_of(at), q, nominal, weights, before, 0.0, change, braking)


def solved(problem: Problem, horizon: Horizon, path=None, braking=True, exact=True, steps=300, tolerance=1e-8):
    """What :func:`minimise_limited` makes of a path, of rest if none is given: its minimum, and the path."""
    path = np.tile(horizon.q, (horizon.knots, 1)) if path is None else path.copy()
    workspace = newton_workspace(problem.task.kind, problem.task.size, *path.shape, True)
    settings = NewtonSettings(exact, steps, tolerance)
    return minimise_limited(path_problem(problem, horizon, braking), path, settings, 0.0, workspace), path
