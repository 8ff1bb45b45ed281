"""Plays the nominal joint path that the trajectory was made from, which is privileged information."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from baselines.policy import Batch, Memory, Solution, statuses
from baselines.solvers.references.privileged_path import PrivilegedPath
from ikgym.validation import FloatArray, frozen_array


@dataclasses.dataclass(frozen=True, eq=False)
class FollowNominal(PrivilegedPath):
    """Goes from wherever the arm is to the nominal joint coordinates of the next step.

    A reference, not a solver to compare with: the joint path is privileged information. Its tracking error is zero
    (where model and arm are the same), its joint velocities are whatever the path asks for, so that solvers with
    foresight can do better at the cost.

    Args:
        problem: What the policy is told of the scenario.
        seed: Which episode of a random scenario to play.
        path: The nominal joint coordinates, one row a step, in [rad] or [m]. Shape (steps + 1, n).

    Raises:
        InvalidInputError: The scenario has no joint path, or is random and there is no seed.
    """

    seed: int | None = None
    path: FloatArray = dataclasses.field(kw_only=True)

    name: ClassVar[str] = "follow_nominal"

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", frozen_array("path", self.path, (None, self.problem.model.joints)))

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        qdot = (self.path[self.next_rows(batch)] - batch.q) / self.problem.dt
        rows = len(qdot)
        return Solution(qdot, memory, statuses(rows), np.zeros(rows, dtype=np.int64))
