"""Joint paths at which the kernels are tested: near their nominal one, with kinks, multipliers and limits in play."""

import dataclasses

import numpy as np

import ikgym
from baselines.policy_kernels import Model, model_block, model_of
from baselines.solvers.receding_horizon.newton.cost import linearise, merit
from baselines.solvers.receding_horizon.newton.grid import Grid, cut, empty_grid, first_knots
from baselines.solvers.receding_horizon.newton.workspace import PathProblem, newton_workspace
from ikgym import TrackingCost
from ikgym.validation import read_only
from tests.baselines.solvers.receding_horizon.data import joint_weights

#: No limit of accelerations. What a policy has read-only is so here: kernels are compiled once for both.
UNLIMITED = read_only(np.zeros(0))


def grid_of(at, steps=None, terminal=1.0) -> Grid:
    """The grid of some knots, cut."""
    at = np.asarray(at, dtype=np.int64)
    grid = empty_grid(len(at))
    return first_knots(grid, cut(at, int(at[-1]) if steps is None else steps, terminal, grid))


def model_tuple(arm, task, cost, dt, bounds) -> Model:
    """Arm, task and cost with any lower, upper and velocity limits; of the types that a policy's model has."""
    limits = np.array([*bounds, *np.full((3, arm.joints), np.inf)])
    return model_of(model_block(Model(arm.chain, task.kind, cost.parameters, dt, bounds[2], limits)))


@dataclasses.dataclass
class Place:
    """A path and everything around it that the kernels are handed."""

    data: Model
    grid: Grid
    start: np.ndarray
    nominal: np.ndarray
    path: np.ndarray
    multipliers: np.ndarray
    error_size: int
    size: int
    more: dict

    @property
    def problem(self):
        weights = joint_weights(len(self.start))
        return PathProblem(self.data, self.grid, self.start, self.nominal, weights, change_limit=UNLIMITED, **self.more)

    @property
    def workspace(self):
        return newton_workspace(self.data.kind, self.size, *self.path.shape)

    def merit(self, path=None):
        path = self.path if path is None else path
        return merit(self.problem, path, self.multipliers, self.workspace)

    def linearise(self, path=None, exact=True, advance=False):
        path = self.path if path is None else path
        workspace = self.workspace
        answer = linearise(self.problem, path, self.multipliers, advance, exact, workspace)
        return answer, workspace.model


def place(
    arm, task, *, seed=0, home=False, delta_x=1e-3, p_x=3.0, limits=True, at=(1, 2, 4, 7), terminal=2.5, **more
) -> Place:
    """A path of velocities of order 1 whose errors are of order Δx, from home or anywhere; more of the problem."""
    arm, task, rng = ikgym.arms.get(arm), ikgym.tasks.get(task), np.random.default_rng(seed)
    n, e, grid = arm.joints, task.error_size, grid_of(at, terminal=terminal)
    dt, knots = delta_x, len(at)  # so that errors and velocities weigh alike
    start = np.zeros(n) if home else rng.uniform(-1.5, 1.5, n)
    path = start + dt * np.cumsum(rng.normal(size=(knots, n)) * grid.length[:, None], axis=0)
    around = np.repeat(path, grid.length.astype(int), axis=0)
    away = rng.normal(size=around.shape) * delta_x
    nominal = task.coordinates(*arm.forward(around + away))
    lower, upper, speed = np.full(n, -np.inf), np.full(n, np.inf), np.full(n, np.inf)
    multipliers = np.zeros((knots, e + 2 * n))
    multipliers[:, :e] = rng.uniform(-1.0, 1.0, (knots, e))
    if limits:
        # Half of the knots lie beyond a limit, and of the others some are still held by a multiplier.
        lower, upper = path.min(axis=0) + 0.3 * dt, path.max(axis=0) + 0.3 * dt
        upper[lower >= upper] = lower[lower >= upper] + dt
        speed[:] = 0.7
        multipliers[:, e:] = rng.normal(size=(knots, 2 * n)) * (rng.random((knots, 2 * n)) < 0.5)
        multipliers[:, e : e + n] *= 100.0
        multipliers[:, e + n :] *= 100.0 / dt
    data = model_tuple(arm, task, TrackingCost(delta_x=delta_x, p_x=p_x), dt, (lower, upper, speed))
    return Place(data, grid, start, nominal, path, multipliers, e, task.size, more)
