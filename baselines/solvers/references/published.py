"""Plays an initial trajectory that others published for a path, which is privileged information."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar, Self

import numpy as np

from baselines.policy import Problem
from baselines.solvers.references.follow_nominal import FollowNominal
from ikgym import problems
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.trajectories import PublishedPath
from ikgym.validation import FloatArray, known_name, whole_number


@dataclasses.dataclass(frozen=True, eq=False)
class Published(FollowNominal):
    """Goes along a published joint path, in straight lines from waypoint to waypoint.

    A reference, and no solver: an initial trajectory for an optimiser, as RL-ITG publishes it. The limits of the arm
    act on it as on everybody; see :mod:`ikgym.problems` for the rule without them.

    Args:
        problem: The scenario as the policy knows it.
        seed: Which episode of a random scenario to play.
        path: Joint coordinates, one row a step, in [rad]. Shape (steps + 1, n).
        method: How it was made: ``greedy``, ``cloning`` or ``reinforcement``.

    Raises:
        InvalidInputError: The scenario has no published path, or is random and there is no seed.
        UnknownNameError: There is no such trajectory of its path; the message has the nearest name.
    """

    method: str = "greedy"

    name: ClassVar[str] = "published"
    positional: ClassVar[str | None] = "method"
    decisive: ClassVar[tuple[str, ...]] = ("method",)

    @classmethod
    def for_scenario(cls, scenario: Scenario, **parameters: Any) -> Self:
        """See :meth:`SolverPolicy.for_scenario`; unlike others this policy is given a joint path.

        Raises:
            InvalidInputError: The scenario has no published path, or is random and there is no seed.
            UnknownNameError: There is no such trajectory of its path.
        """
        path = _path(scenario, parameters.get("seed"))
        method, joints = parameters.get("method", cls.method), problems.get(path.problem).trajectories
        known_name(f"initial trajectory of {path.problem}", method, joints)
        times = scenario.times(scenario.steps + 1)
        return cls(Problem.of(scenario), path=_along(joints[method], scenario, times / path.period), **parameters)


def _path(scenario: Scenario, seed: int | None) -> PublishedPath:
    trajectory = scenario.episode(None if seed is None else whole_number("seed", seed, at_least=0))
    if not isinstance(trajectory, PublishedPath):
        raise InvalidInputError(f"published: expected a scenario with a published path, got {scenario.name!r}.")
    return trajectory


def _along(joints: FloatArray, scenario: Scenario, at: FloatArray) -> FloatArray:
    """The joint path at waypoints and between them; joints without limits do not jump by full turns."""
    turning = np.isinf(scenario.arm.upper - scenario.arm.lower)
    joints = np.where(turning, np.unwrap(joints, axis=0), joints)
    numbers = np.arange(len(joints))
    return np.column_stack([np.interp(at, numbers, joint) for joint in joints.T])
