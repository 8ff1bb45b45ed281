"""Plays a joint path that is planned along the whole reference, before the episode begins."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar, Self

import numpy as np

from baselines.paths.routes import Routes
from baselines.policy import Problem
from baselines.solvers.references.follow_nominal import FollowNominal
from ikgym.exceptions import InvalidInputError
from ikgym.plant import Plant
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, number

#: The joint path is planned at knots this far apart in [s], or a little nearer; a full turn in [rad].
SPACING, TURN = 0.2, 2.0 * np.pi


@dataclasses.dataclass(frozen=True, eq=False)
class Planned(FollowNominal):
    """Goes along the joint path that :class:`baselines.paths.routes.Routes` finds from the start to the end.

    The whole reference and the obstacles are known to it when the episode begins, and planning takes seconds: a
    reference, and no solver for a controller. Its poses are met exactly. Between knots the motion is nearly even, so
    that velocities leap there: the arm may have no limits of acceleration. Where no way leads on, it stands still.

    Args:
        problem: The scenario as the policy knows it.
        seed: Not used: the path is the same at every reset.
        path: The planned joint path, one row a step, in [rad] or [m]. Shape (steps + 1, n).
        largest: Largest motion of a revolute joint between two knots in [rad], where it is less than nine tenths
            of the velocity limits allow.

    Raises:
        InvalidInputError: The scenario is random, its task has no position or an incomplete orientation, or the arm has
            limits of acceleration.
    """

    largest: float = TURN

    name: ClassVar[str] = "planned"
    decisive: ClassVar[tuple[str, ...]] = ("largest",)

    @classmethod
    def for_scenario(cls, scenario: Scenario, **parameters: Any) -> Self:
        """See :meth:`SolverPolicy.for_scenario`; unlike others this policy is given a planned joint path.

        Raises:
            InvalidInputError: The scenario is random, or its task or arm is of another kind.
        """
        if np.isfinite(scenario.model.acceleration_limit).any():
            raise InvalidInputError(
                f"{cls.name} plans no accelerations; scenario {scenario.name!r}: expected an arm without limits of "
                "acceleration. `rhc_foresight` and `qp` keep them."
            )
        largest = number("largest", parameters.get("largest", cls.largest), above=0.0)
        return cls(Problem.of(scenario), path=path(scenario, largest), **parameters)


def path(scenario: Scenario, largest: float = TURN) -> FloatArray:
    """The planned joint path of a scenario, one row a step, in [rad] or [m]; see :class:`Planned`. (steps + 1, n)."""
    known = scenario.replace(arm=scenario.model, plant=Plant())
    stride = max(1, int(SPACING / scenario.dt + 1e-9))
    knots = np.minimum(np.arange(0, scenario.steps + stride, stride), scenario.steps)
    most = 0.9 * stride * scenario.dt * np.minimum(scenario.velocity_limit, scenario.model.velocity_limit)
    most = np.where(known.arm.prismatic, most, np.minimum(most, largest))
    found = Routes(known, scenario.dt * knots, most).route(known.start_of())
    return between(known, knots[: len(found)], found)


def between(scenario: Scenario, knots: FloatArray, q: FloatArray) -> FloatArray:
    """A joint path at every step from that at knots, which goes through the poses exactly, and rests where it ends.

    Args:
        scenario: The scenario.
        knots: Numbers of steps. Shape (k,).
        q: Joint coordinates at the knots, in [rad] or [m]. Shape (k, n).

    Returns:
        Shape (steps + 1, n).
    """
    steps = np.arange(scenario.steps + 1)
    even = np.column_stack([np.interp(steps, knots, joint) for joint in q.T])
    frames = scenario.frames(scenario.trajectory, len(steps))
    rotations = frames[:, :9].reshape(-1, 3, 3) if scenario.task.has_orientation else None
    exact, met = scenario.arm.inverse(rotations, frames[:, -3:], start=even, restarts=0)
    return np.where((met & (steps <= knots[-1]))[:, None], exact, even)
