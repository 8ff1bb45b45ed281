"""Any policy, shown whole poses where the scenario shows skew coordinates."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

from baselines.policy import Batch, Memory, Problem, Solution
from baselines.solvers.wrappers import orientation
from baselines.wrapper import NamedWrapper
from ikgym.scenarios.preview import furthest


@dataclasses.dataclass(frozen=True, eq=False)
class FullOrientation(NamedWrapper):
    """Lets a policy see whole poses, where the scenario shows the skew coordinates of Varga 2021.

    Skew coordinates are the same for a rotation by θ and by 180° − θ, and their Jacobian is singular at 90°. That is
    where most solvers lose the arm. :func:`orientation.resolve_orientation` resolves this 90° ambiguity, and the inner
    policy is given the task `pose`: it tracks the same motion without it. The cost stays that of the skew coordinates.
    This method is of this project.

    Args:
        problem: What the policy is told of the scenario.
        policy: The name of the inner policy.
        options: Its parameters; those left out have its defaults.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The task is not `skew`, the policy is a reference or made from others, or it refuses its
            parameters.
    """

    name: ClassVar[str] = "full_orientation"
    nests: ClassVar[bool] = False

    def inner_problem(self) -> Problem:
        """The same with whole poses."""
        return orientation.full_problem(self.problem)

    def own_memory(self, rows: int) -> orientation.OrientationMemory:
        """See :func:`orientation.start_memory`."""
        return orientation.start_memory(rows)

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        own, inside = self.split(memory)
        shown = batch._replace(nominal=batch.nominal[:, : furthest(self.inner.preview)])
        seen, kept = orientation.resolve_orientation(self.problem, shown, own)
        step = self.ask(seen, inside)
        return self.solution(step.action * self.problem.velocity_limit, kept, step)
