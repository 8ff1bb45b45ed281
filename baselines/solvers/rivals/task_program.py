"""What Pink and mink have in common: weighted tasks under limits, one quadratic program a step."""

from __future__ import annotations

import abc
import dataclasses

from baselines.policy.parameters import parameter
from baselines.solvers.rivals.base import Rival
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.validation import number


@dataclasses.dataclass(frozen=True, eq=False)
class TaskProgram(Rival, abc.ABC):
    """Minimises a frame task and a posture task under the limits of position and velocity.

    ‖W (J Δq − gain · e)‖² + μ ‖Δq‖² + posture_cost² ‖Δq − posture_rate Δt (q* − q)‖² + damping ‖Δq‖², with W of
    `position_cost` and `orientation_cost`, and μ of `lm_damping`. q* is the posture at the start. Costs and damping are
    those of Pink's example of an arm. There the posture task asks for the whole way back in one step; here for that
    share of it which takes a second, since the other loses the arm on `panda-singular`.

    Args:
        problem: What the policy is told of the scenario.
        gain: Of the frame task. Above 0, at most 1; 1 is deadbeat control.
        position_cost: Of the frame task, in [1/m].
        orientation_cost: Of the frame task, in [1/rad].
        lm_damping: μ by the squared cost of the error: Levenberg–Marquardt damping of the frame task.
        posture_cost: In [1/rad]; 0 for no posture task.
        posture_rate: Share of the way to the posture that is asked for in a second, in [1/s].
        damping: Of the whole program.
        limit_gain: Share of the distance to a position limit that a step may take. Above 0, at most 1.
        solver: Of the program, a name of `qpsolvers`.

    Raises:
        InvalidInputError: See :class:`Rival`; or a parameter is out of its range.
        UnknownNameError: There is no such solver, or it is not installed.
        MissingDependencyError: The package, or `qpsolvers`, is not installed.
    """

    gain: float = parameter(1.0, number, above=0.0, at_most=1.0)
    position_cost: float = parameter(1.0, number, above=0.0)
    orientation_cost: float = parameter(1.0, number, at_least=0.0)
    lm_damping: float = parameter(1.0, number, at_least=0.0)
    posture_cost: float = parameter(1e-3, number, at_least=0.0)
    posture_rate: float = parameter(1.0, number, at_least=0.0)
    damping: float = parameter(1e-12, number, at_least=0.0)
    limit_gain: float = parameter(0.5, number, above=0.0, at_most=1.0)
    solver: str = "daqp"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.share > 1.0:
            raise InvalidInputError(f"posture_rate · Δt: expected at most 1, got {self.share:g}.")
        known = self.imported("qpsolvers").available_solvers
        if self.solver not in known:
            raise UnknownNameError("solver of quadratic programs", self.solver, tuple(known))

    @property
    def frame_costs(self) -> tuple[list[float], list[float]]:
        """Costs of the frame task along the tool's axes, of its position and of its orientation."""
        turns = {"position": [0.0] * 3, "axis": [self.orientation_cost, self.orientation_cost, 0.0]}
        return [self.position_cost] * 3, turns.get(self.problem.task.name, [self.orientation_cost] * 3)

    @property
    def share(self) -> float:
        """Of the way to the posture that is asked for in one step."""
        return self.posture_rate * self.problem.dt
