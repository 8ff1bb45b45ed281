"""Plays the nominal joint path that the trajectory was made from, which is privileged information."""

from __future__ import annotations

import abc
import dataclasses
from typing import Any, ClassVar, Self

import numpy as np

from baselines.policy import Batch, Memory, Problem, Solution, SolverPolicy, statuses
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, Seed, frozen_array, whole_number


class PrivilegedPath(SolverPolicy, abc.ABC):
    """Base of policies with the fields ``seed``, which episode of a random scenario is played, and ``path``.

    The path is privileged information: joint coordinates, one row a step, in [rad] or [m]. Shape (steps + 1, n).
    """

    seed: int | None
    path: FloatArray

    reference: ClassVar[bool] = True

    @classmethod
    def for_scenario(cls, scenario: Scenario, **parameters: Any) -> Self:
        """See :meth:`SolverPolicy.for_scenario`; unlike others this policy is given the nominal joint path.

        Raises:
            InvalidInputError: The scenario has no joint path, or is random and there is no seed.
        """
        seed = parameters.get("seed")
        if seed is not None:
            parameters["seed"] = whole_number("seed", seed, at_least=0)
        path = scenario.nominal_joint_path(seed)
        if path is None:
            raise InvalidInputError(
                f"{cls.name} needs a nominal joint path; scenario {scenario.name!r} is given in Cartesian space."
            )
        return cls(Problem.of(scenario), path=path, **parameters)  # type: ignore[call-arg]  # a field of subclasses

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`; to the row of the path that belongs to the end of the step."""
        last, rows = len(self.path) - 1, len(batch.q)
        ends = np.clip(last + 1 - batch.remaining[:, 0].astype(np.int64), 0, last)
        qdot = (self.path[ends] - batch.q) / self.problem.dt
        return Solution(qdot, memory, statuses(rows), np.zeros(rows, dtype=np.int64))


@dataclasses.dataclass(frozen=True, eq=False)
class FollowNominal(PrivilegedPath):
    """Goes from wherever the arm is to the nominal joint coordinates of the next step.

    A reference, not a solver to compare with: the joint path is privileged information. Its tracking error is zero
    (where model and arm are the same), its joint velocities are whatever the path asks for, so that solvers with
    foresight can do better at the cost.

    Args:
        problem: The scenario as the policy knows it.
        seed: Which episode of a random scenario to play.
        path: The nominal joint coordinates, one row a step, in [rad] or [m]. Shape (steps + 1, n).

    Raises:
        InvalidInputError: The scenario has no joint path, or is random and there is no seed.
    """

    seed: Seed | None = None
    path: FloatArray = dataclasses.field(kw_only=True)

    name: ClassVar[str] = "follow_nominal"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle(path=frozen_array("path", self.path, (None, self.problem.model.joints)))
