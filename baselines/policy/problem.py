"""The problem of a policy."""

from __future__ import annotations

import dataclasses
import functools
from typing import Self

import numpy as np

from baselines.policy_kernels import JERK, Model, model_block, model_of
from ikgym.arms import Arm
from ikgym.cost import TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.kernels.bodies import Shapes, Surroundings
from ikgym.kernels.tasks import pose_rows
from ikgym.plant.sweep import sweep
from ikgym.scenarios import Scenario
from ikgym.tasks import Task
from ikgym.validation import LARGEST, BoolArray, FloatArray, frozen_array, read_only

# Actions in float32 miss a velocity by up to this share of the one that an action of 1 means.
ROUNDING = 2.0**-24
#: Most periods in which an acceleration builds up with the least limit of jerk.
LONGEST_RISE = 1000


@dataclasses.dataclass(frozen=True, eq=False)
class Problem(Frozen):
    """The scenario as a policy knows it: with the model of the arm, which may differ from the arm that moves.

    Args:
        model: The arm as the solver knows it.
        task: The task coordinates.
        cost: The stage cost.
        dt: Δt in [s].
        velocity_limit: Joint velocity of an action of 1, in [rad/s] or [m/s]. Shape (n,).
        surroundings: The obstacles as they are at the start; None where touching does not matter.
        obstacles_shown: Whether observations show the obstacles, which are others at each step or in each episode.
        jerk_limit: Largest changes of the joint accelerations in [rad/s³] or [m/s³], inf where there is none; None for
            none. Shape (n,).
    """

    model: Arm
    task: Task
    cost: TrackingCost
    dt: float
    velocity_limit: FloatArray
    surroundings: Surroundings | None = None
    obstacles_shown: bool = False
    jerk_limit: FloatArray | None = None

    def __post_init__(self) -> None:
        self._settle(velocity_limit=frozen_array("velocity_limit", self.velocity_limit, (self.model.joints,)))
        if self.jerk_limit is not None and np.isfinite(self.jerk_limit).any():
            self._check_jerk(self.jerk_limit)

    def _check_jerk(self, jerk_limit: FloatArray) -> None:
        """Refuses limits of jerk with which accelerations take too many steps to build up."""
        change = self.dt * self.model.acceleration_limit
        least = np.minimum(change / LONGEST_RISE, 2.0 * self.largest_qdot / LONGEST_RISE**2) / self.dt**2
        if (low := jerk_limit < least).any():
            j = int(np.argmax(low))
            unit = "m" if self.model.prismatic[j] else "rad"
            raise InvalidInputError(
                f"jerk_limit: expected at least {least[j]:.3g} {unit}/s³ for joint {self.model.joint_names[j]!r}, so "
                f"that its acceleration builds up within {LONGEST_RISE} periods of {1e3 * self.dt:g} ms, since stops "
                f"are computed period by period; got {jerk_limit[j]:.3g}."
            )

    @property
    def largest_qdot(self) -> FloatArray:
        """The largest joint velocities that actions and the limits of the model allow. Shape (n,)."""
        return np.minimum(self.velocity_limit, self.model.velocity_limit)

    @functools.cached_property
    def limits(self) -> FloatArray:
        """The limits as kernels take them, see :class:`baselines.policy_kernels.Model`. Shape (6, n).

        Braking may use a little less than the limits of acceleration and jerk: a joint that brakes as hard as it can
        cannot make up for the rounding of its actions, and would touch its stop. A jerk that changes the acceleration
        from one end to the other within a step is no limit.
        """
        change = self.dt * self.model.acceleration_limit
        braking = np.maximum(change - 2.0 * ROUNDING * self.velocity_limit, 0.5 * change)
        jerk = self.dt * self.dt * (np.inf if self.jerk_limit is None else self.jerk_limit)
        steps = np.maximum(jerk - 4.0 * ROUNDING * self.velocity_limit, 0.5 * jerk)
        steps = np.where(jerk < (2.0 - 1e-9) * change, steps, np.inf)
        model = self.model
        return read_only(np.array([model.lower, model.upper, self.largest_qdot, change, braking, steps]))

    @property
    def jerk_limited(self) -> bool:
        """Whether any joint has a limit of jerk that matters at this period."""
        return bool(np.isfinite(self.limits[JERK]).any())

    @functools.cached_property
    def kernel_block(self) -> FloatArray:
        """:attr:`kernel_model` as one block, for calls that take microseconds."""
        fixed = self.model.chain, self.task.kind, self.cost.parameters, self.dt
        return model_block(Model(*fixed, self.velocity_limit, self.limits))

    @functools.cached_property
    def kernel_model(self) -> Model:
        """Model, task, cost and limits as the kernels of all solvers take them."""
        model: Model = model_of(self.kernel_block)  # of the types that the kernels behind `predict` are compiled for
        return model

    def poses(self, q: FloatArray) -> FloatArray:
        """Task coordinates of the model at joint coordinates of shape (B, n). Shape (B, m)."""
        out = np.empty((len(q), self.task.size))
        pose_rows(self.model.chain, self.task.kind, q, out)
        return out

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """The problem of a scenario."""
        usual = scenario.model, scenario.task, scenario.cost, scenario.dt, scenario.velocity_limit
        if not scenario.collides:
            return cls(*usual, jerk_limit=scenario.jerk_limit)
        model = scenario.model.replace(bodies=scenario.arm.bodies)
        return cls(model, *usual[1:], scenario.surroundings, scenario.obstacles_shown, scenario.jerk_limit)


def surroundings_of(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """The bodies of a problem, see :func:`bodies_block`, and the obstacles at the start of an episode.

    There are none where touching does not matter. Shapes (any,), (1, o, 16).
    """
    bodies, known = problem.model.bodies, problem.surroundings
    boxes, checked = bodies.surroundings(()) if known is None else known
    return bodies_block(bodies.shapes, checked), boxes[None].copy()


def bodies_block(shapes: Shapes, checked: BoolArray) -> FloatArray:
    """Bodies, and which may not touch which obstacle, (o, k), in one block: an array costs a call 0.15 µs."""
    counts = [len(shapes.links), len(shapes.pairs), len(checked)]
    return np.concatenate([counts, *map(np.ravel, shapes), checked.ravel()]).astype(np.float64)


def sweep_bodies(arm: Arm) -> FloatArray:
    """How far each joint of an arm moves each body at most within the limits, in [m] per unit. Shape (k, n)."""
    travel = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    return sweep(arm, np.where(arm.prismatic, np.minimum(travel, LARGEST), 0.0), 0.0)
