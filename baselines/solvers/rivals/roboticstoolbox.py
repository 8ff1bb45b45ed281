"""Resolved-rate motion control of the Robotics Toolbox for Python."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np

from baselines.solvers.rivals.base import Rival, Seen, Step
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray, number


@dataclasses.dataclass(frozen=True, eq=False)
class RoboticsToolbox(Rival):
    """The resolved-rate controller of the toolbox (Corke and Haviland): v = p_servo(T, T*), q̇ = J⁺ v.

    As its documentation has it: the velocity of the tool in the tool's own frame, and the pseudo-inverse of numpy. It
    knows no limits. The model is handed over joint by joint, as an elementary transform sequence.

    Args:
        problem: What the policy is told of the scenario.
        gain: Share of the way to the target that is asked for in one step, `p_servo`'s gain times Δt. Above 0 and
            below 2; 1 is deadbeat control.

    Raises:
        InvalidInputError: See :class:`Rival`; or the gain is out of its range.
        MissingDependencyError: The toolbox is not installed.
    """

    gain: float = 1.0

    name: ClassVar[str] = "roboticstoolbox"
    package: ClassVar[str] = "roboticstoolbox"
    distribution: ClassVar[str] = "roboticstoolbox-python"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "gain", number("gain", self.gain, above=0.0))
        if self.gain >= 2.0:
            raise InvalidInputError(f"gain: expected a number above 0 and below 2, got {self.gain:g}.")

    def make_step(self) -> Step:
        """See :meth:`Rival.make_step`."""
        toolbox = self.imported()
        chain = self._chain(toolbox)
        rows = {"position": 3, "axis": 5}.get(self.problem.task.name, 6)  # z of the angular velocity comes last
        rate, goal = self.gain / self.problem.dt, np.eye(4)

        def step(seen: Seen) -> FloatArray | None:
            goal[:3, :3], goal[:3, 3] = seen.target
            velocity, _ = toolbox.p_servo(chain.eval(seen.q), goal, rate)
            found: FloatArray = np.linalg.pinv(chain.jacobe(seen.q)[:rows]) @ velocity[:rows]
            return found

        return step

    def _chain(self, toolbox: Any) -> Any:
        """The model as elementary transforms: z turned onto each joint's axis, and back."""
        et, model = toolbox.ET, self.problem.model
        transforms = []
        for offset, axis, prismatic in zip(model.offsets, model.axes, model.prismatic, strict=True):
            there = _pose(_onto_z(axis).T)
            transforms += [et.SE3(_pose(position=offset)), et.SE3(there), et.tz() if prismatic else et.Rz()]
            transforms.append(et.SE3(there.T))
        return toolbox.ETS([*transforms, et.SE3(_pose(model.tool_rotation, model.tool))])


def _onto_z(axis: FloatArray) -> FloatArray:
    """A rotation whose last row is an axis. Shape (3, 3)."""
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    return np.array([across, np.cross(axis, across), axis])


def _pose(rotation: FloatArray | None = None, position: FloatArray | None = None) -> FloatArray:
    out = np.eye(4)
    out[:3, :3] = np.eye(3) if rotation is None else rotation
    out[:3, 3] = 0.0 if position is None else position
    return out
