"""Input and output of a policy: problem, observations, solution."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from ikgym.arms import Arm
from ikgym.arms.limits import limit_rows
from ikgym.cost import TrackingCost
from ikgym.frozen import Frozen
from ikgym.kernels.bodies import Surroundings
from ikgym.kernels.tasks import pose_rows
from ikgym.scenarios import Scenario
from ikgym.tasks import Task
from ikgym.validation import FloatArray, frozen_array, read_only

#: Arrays with a leading axis of B: the memory of a policy, or a whole state, see :mod:`baselines.policy.arguments`.
Memory = tuple[npt.NDArray[Any], ...]


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
    """

    model: Arm
    task: Task
    cost: TrackingCost
    dt: float
    velocity_limit: FloatArray
    surroundings: Surroundings | None = None
    obstacles_shown: bool = False

    def __post_init__(self) -> None:
        self._settle(velocity_limit=frozen_array("velocity_limit", self.velocity_limit, (self.model.joints,)))

    @property
    def largest_qdot(self) -> FloatArray:
        """The largest joint velocities that actions and the limits of the model allow. Shape (n,)."""
        return np.minimum(self.velocity_limit, self.model.velocity_limit)

    @functools.cached_property
    def limit_rows(self) -> FloatArray:
        """The limits of an ideal arm of this model, see :func:`ikgym.arms.limits.limit_rows`. Shape (4 or 0, n)."""
        return read_only(limit_rows(self.model, self.largest_qdot, self.dt))

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
            return cls(*usual)
        model = scenario.model.replace(bodies=scenario.arm.bodies)
        return cls(model, *usual[1:], scenario.surroundings, scenario.obstacles_shown)


class Batch(NamedTuple):
    """Observations of B arms, as float64.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        qdot: Joint velocities last applied, in [rad/s] or [m/s]; where a policy remembers it, its last command, see
            :attr:`SolverPolicy.remembers_command`. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        nominal: Nominal task coordinates ahead, X^N(k+1) first. Shape (B, p, m).
        remaining: Steps left. Shape (B, 1).
        q_age: How many steps ago q was measured; None where the observation does not say. Shape (B, 1).
        pose_age: The same of the pose. Shape (B, 1).
        commands: The last commands as joint velocities, newest first, in [rad/s] or [m/s]; None where they are not
            observed. Shape (B, h, n).
        obstacles: Obstacles as they will be after the coming step, see :class:`ikgym.kernels.bodies.Surroundings`;
            None where they are always the same. Shape (B, o, 16).
    """

    q: FloatArray
    qdot: FloatArray
    pose: FloatArray
    nominal: FloatArray
    remaining: FloatArray
    q_age: FloatArray | None = None
    pose_age: FloatArray | None = None
    commands: FloatArray | None = None
    obstacles: FloatArray | None = None


class Solution(NamedTuple):
    """The result of a solver.

    Attributes:
        qdot: Joint velocities in [rad/s] or [m/s]. Shape (B, n).
        memory: Memory for the next step, each array with a leading axis of B.
        status: Values of :class:`Status`. Shape (B,).
        iterations: Iterations made. Shape (B,).
    """

    qdot: FloatArray
    memory: Memory
    status: npt.NDArray[np.int64]
    iterations: npt.NDArray[np.int64]
