"""The whole of an episode as one problem: a joint path through all steps that count."""

from __future__ import annotations

import dataclasses
from typing import Self

import numpy as np
from gymnasium.utils import seeding

from baselines.episodes import add_up, begin, rollouts
from baselines.policy import Problem, SolverPolicy
from baselines.policy.problem import sweep_bodies
from baselines.policy_kernels import Model
from baselines.solvers.receding_horizon.newton.bodies import INFLUENCE, Clearance
from baselines.solvers.receding_horizon.newton.grid import Grid
from baselines.solvers.receding_horizon.newton.workspace import PathProblem
from ikgym.exceptions import InvalidInputError
from ikgym.plant import Plant
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, read_only, whole_number

# Knots at the beginning that a coarse grid has, too: an arm that starts far off its trajectory gets there in a few.
FIRST = 8
# Least distance of bodies at the knots, in [m]: between two it may be less, and at 1 µm the plant stops the arm.
CLEARANCE = 1e-4


@dataclasses.dataclass(frozen=True, eq=False)
class EpisodeProblem:
    """An episode from its start to its end, as the kernels of :mod:`baselines.solvers.receding_horizon.newton` see it.

    Each step that counts has a knot. Where a nominal point is held for h > 1 steps the arm moves in h - 1 of
    them, which cost nothing, and rests in the last, which counts.

    Args:
        scenario: The tracking problem.
        seed: The reset seed.
        data: The arm itself, not its model, with its limits of position and velocity.
        start: Joint coordinates at the start in [rad] or [m]. Shape (n,).
        nominal: Nominal task coordinates after the steps 1, 2, … Shape (steps, m).
        grid: K knots, one a step that counts.
        clearance: Bodies and obstacles of the episode; None where touching does not matter.
    """

    scenario: Scenario
    seed: int
    data: Model
    start: FloatArray
    nominal: FloatArray
    grid: Grid
    clearance: Clearance | None

    @classmethod
    def of(cls, scenario: Scenario, seed: int) -> Self:
        """The episode that a reset with the seed begins.

        Raises:
            InvalidInputError: The seed is no whole number of at least 0, or the scenario's plant is not ideal, or it
                has a cost of proximity, or both limits of acceleration and points that are held.
        """
        whole_number("seed", seed, at_least=0)
        payload = {name: getattr(scenario.plant, name) for name in ("payload", "payload_step")}
        if scenario.plant != Plant(**payload):
            raise InvalidInputError(
                "The best cost of an episode is that of a joint path of the arm in the data sheet; scenario "
                f"{scenario.name!r}: expected an ideal plant, except a payload, got {scenario.plant}."
            )
        if scenario.proximity is not None:
            raise InvalidInputError(
                "The search minimises tracking and velocity costs alone; scenario "
                f"{scenario.name!r}: expected no proximity, got {scenario.proximity}."
            )
        limited = bool(np.isfinite(scenario.arm.acceleration_limit).any())
        if limited and not scenario.counted()[1:].all():
            raise InvalidInputError(
                "Between held points the search does not look at how the arm gets from one to the next; scenario "
                f"{scenario.name!r}: expected iterations_per_point=1 with the limits of acceleration of arm "
                f"{scenario.arm.name!r}, got {scenario.iterations_per_point}."
            )
        arm = Problem(scenario.arm, scenario.task, scenario.cost, scenario.dt, scenario.velocity_limit)
        at = np.flatnonzero(scenario.counted())
        held = np.diff(at, prepend=0)
        grid = Grid(at, np.maximum(held - 1.0, 1.0), np.ones(len(at)), (held == 1).astype(np.float64))
        trajectory = scenario.trajectory.sample(seeding.np_random(seed)[0])
        start = np.array(scenario.first_q(trajectory), dtype=np.float64)
        nominal = np.ascontiguousarray(scenario.nominal(seed)[1:])
        return cls(scenario, seed, arm.kernel_model, start, nominal, grid, _clearance(scenario, seed))

    def on(self, grid: Grid) -> PathProblem:
        """The problem on a grid, as the kernels see it."""
        change = self.scenario.dt * self.scenario.arm.acceleration_limit if self._by_interior_point else np.zeros(0)
        # Writable arrays are another type to numba, for which it would compile once more all that `rhc` calls.
        limit, equal, rest = read_only(change), read_only(np.ones_like(self.start)), np.zeros_like(self.start)
        load, clearance = self._load(grid), self.clearance
        return PathProblem(self.data, grid, self.start, self.nominal, equal, rest, 0.0, limit, False, load, clearance)

    def _load(self, grid: Grid) -> FloatArray:
        """Offset of the joint zeros by the payload at the knots; (0, n) where there is none. Shape (K, n)."""
        plant, n = self.scenario.plant, self.scenario.joints
        if not np.any(plant.payload):
            return np.zeros((0, n))
        return np.where(grid.at[:, None] >= plant.payload_step, np.broadcast_to(plant.payload, n), 0.0)

    @property
    def _by_interior_point(self) -> bool:
        """Whether paths are improved by the interior point method, which finds its way between limits of any kind."""
        limited = self.scenario.arm.limited or self.clearance is not None
        return limited and bool(self.scenario.counted()[1:].all())

    @property
    def knots(self) -> int:
        """K."""
        return len(self.grid.at)

    def coarse(self, stride: int) -> Grid:
        """A grid with the first knots, every ``stride``-th of the others, and the last.

        The tracking costs between two knots follow the trapezoidal rule, as in :func:`grid.cut`.
        """
        last = self.knots - 1
        first_ones = np.arange(min(FIRST, last))
        ends = np.concatenate([first_ones, np.arange(len(first_ones) + stride - 1, last, stride), [last]])
        first = np.append(0, ends[:-1] + 1)
        counts = np.diff(ends, prepend=-1)
        tracking = 0.5 * (counts + 1.0)
        tracking[:-1] += 0.5 * (counts[1:] - 1.0)
        length, velocity = (np.add.reduceat(values, first) for values in (self.grid.length, self.grid.velocity))
        return Grid(self.grid.at[ends], length, tracking, velocity)

    def refine(self, grid: Grid, path: FloatArray) -> FloatArray:
        """A path through the knots of a coarse grid at all knots. Shape (K, n)."""
        fine, knots = np.cumsum(self.grid.length), np.append(0.0, np.cumsum(grid.length))
        q = np.vstack([self.start, path])
        return np.stack([np.interp(fine, knots, column) for column in q.T], axis=1)

    def through(self, q: FloatArray) -> FloatArray:
        """The knots of a path, from the joint coordinates after each step. Shapes (steps, n) and (K, n)."""
        return np.ascontiguousarray(q[self.grid.at - 1])

    def feasible(self, path: FloatArray) -> FloatArray:
        """A path within the limits of position and velocity: the nearest that the arm gets to each knot from the last.

        A path (K, n) that keeps the limits stays as it is.
        """
        arm, most = self.scenario.arm, self.scenario.dt * self.grid.length[:, None] * self.scenario.largest_qdot
        out = np.clip(path, arm.lower, arm.upper)
        here = self.start
        if (np.abs(np.diff(out, axis=0, prepend=here[None])) > most).any():
            for knot, way in zip(out, most, strict=True):
                knot[:] = np.where(np.abs(knot - here) > way, here + np.copysign(way, knot - here), knot)
                here = knot
        return out

    def commands(self, path: FloatArray) -> FloatArray:
        """The joint velocities that lead along a path (K, n), in [rad/s] or [m/s]; one row a step. Shape (steps, n)."""
        moves = np.diff(path, axis=0, prepend=self.start[None]) / self.scenario.dt
        held = np.diff(self.grid.at, prepend=0)
        qdot = moves / self.grid.length[:, None]
        every = np.repeat(qdot, held, axis=0)
        every[self.grid.at[held > 1] - 1] = 0.0
        return every

    def play(self, qdot: FloatArray) -> tuple[FloatArray, float]:
        """Plays joint velocities (steps, n) in [rad/s] or [m/s] in the environment.

        Returns:
            Joint coordinates after each step in [rad] or [m], of shape (steps, n), and the total cost; infinite where
            bodies touch at a step or between two, so that the arm is stopped.
        """
        arms, _ = begin(self.scenario, [self.seed], preview=1, single=True)
        q, costs, stopped = np.empty_like(qdot), np.empty(len(qdot)), False
        for k, action in enumerate(qdot / self.scenario.velocity_limit):
            out = arms.step(action)
            q[k], costs[k] = out.true_q[0], out.cost[0]
            stopped = stopped or bool(out.stopped.any())
        return q, np.inf if stopped else float(add_up(costs))


def path_of(policy: SolverPolicy, scenario: Scenario, seed: int) -> FloatArray:
    """The joint coordinates of an episode that a policy plays, in [rad] or [m]. Shape (steps, n)."""
    return rollouts(scenario, policy, [seed])[0].q


def _clearance(scenario: Scenario, seed: int) -> Clearance | None:
    """Bodies and obstacles of an episode, at each of its steps; None where touching does not matter."""
    if not scenario.collides:
        return None
    drawn = scenario.replace(obstacles=scenario.obstacles_of(seed))
    boxes, checked = drawn.obstacle_rows(scenario.steps + 1), drawn.surroundings.checked
    shapes = scenario.arm.bodies.shapes
    return Clearance(shapes, boxes, checked, sweep_bodies(scenario.arm), CLEARANCE, CLEARANCE + INFLUENCE)
