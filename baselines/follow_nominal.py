"""The privileged reference: plays the nominal joint path that the trajectory was made from."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Problem, Solution, SolverPolicy, statuses
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, frozen_array, whole_number


@dataclasses.dataclass(frozen=True, eq=False)
class FollowNominal(SolverPolicy):
    """Goes from wherever the arm is to the nominal joint coordinates of the next step.

    A reference, not a contender: it knows the joint path, which no observation shows. Its tracking error is zero
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
    reference: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", frozen_array("path", self.path, (None, self.problem.model.joints)))

    @classmethod
    def for_scenario(cls, scenario: Scenario, **parameters: Any) -> Self:
        """See :meth:`SolverPolicy.for_scenario`; unlike all others this policy is handed the joint path."""
        seed = parameters.get("seed")
        if seed is not None:
            parameters["seed"] = whole_number("seed", seed, at_least=0)
        path = scenario.nominal_joint_path(seed)
        if path is None:
            raise InvalidInputError(
                f"follow_nominal needs a nominal joint path; scenario {scenario.name!r} is given in Cartesian space."
            )
        return cls(Problem.of(scenario), path=path, **parameters)

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        last = len(self.path) - 1
        step = np.clip(last - batch.remaining[:, 0].astype(np.int64) + 1, 0, last)
        qdot = (self.path[step] - batch.q) / self.problem.dt
        rows = len(qdot)
        return Solution(qdot, memory, statuses(rows), np.zeros(rows, dtype=np.int64))

    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """Nothing: all was known before."""
        return 0, 0, 0, 0
