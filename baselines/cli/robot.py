"""A robot of one's own and a path in a file, as options that several commands have."""

from __future__ import annotations

import dataclasses
import math
import pathlib
from typing import Annotated

import tyro

from ikgym import arms, tasks
from ikgym.arms import Arm
from ikgym.scenarios import Scenario
from ikgym.trajectories import from_csv
from ikgym.validation import per_joint

#: The tool comes to its speed within this time, in [s].
SPEEDING_UP = 0.2


@dataclasses.dataclass(frozen=True, kw_only=True)
class RobotOptions:
    """The chain of a URDF file, and what the file does not say."""

    base: Annotated[str | None, tyro.conf.arg(metavar="LINK")] = None
    """Link of a URDF file at which the arm begins; the root if left out."""
    tip: Annotated[str | None, tyro.conf.arg(metavar="LINK")] = None
    """Link at which it ends; needed where several could."""
    tool: Annotated[tuple[float, float, float] | None, tyro.conf.arg(metavar="X Y Z")] = None
    """Tool point in the frame of the tip, in [m]."""
    acceleration: Annotated[tuple[float, ...], tyro.conf.arg(metavar="A …")] = ()
    """Acceleration limit, or one a joint, in [rad/s²] or [m/s²]; a URDF file states none."""

    def arm(self, file: str) -> Arm:
        """The arm of a URDF file, or of the catalogue by its name.

        Raises:
            InvalidInputError: The file has no such chain, or a number is out of range.
            UnknownNameError: There is no such arm or link.
            MissingDependencyError: Pinocchio is not installed.
        """
        urdf = file.endswith(".urdf")
        arm = arms.from_urdf(file, base=self.base, tip=self.tip, tool=self.tool) if urdf else arms.get(file)
        if not self.acceleration:
            return arm
        limit = self.acceleration[0] if len(self.acceleration) == 1 else self.acceleration
        return arm.replace(acceleration_limit=per_joint("--acceleration", limit, arm.joints))


@dataclasses.dataclass(frozen=True, kw_only=True)
class PathOptions(RobotOptions):
    """A robot, and how fast it drives along a path."""

    dt: Annotated[float, tyro.conf.arg(metavar="S")] = 0.004
    """Control period in [s]."""
    speed: Annotated[float | None, tyro.conf.arg(metavar="V")] = None
    """Speed of the tool in [m/s], reached within 0.2 s; needed where the path has no column t."""

    def scenario(self, robot: str, path: str) -> Scenario:
        """The scenario of a robot on the path in a CSV file, see :func:`ikgym.trajectories.from_csv`.

        Raises:
            InvalidInputError: A file cannot be read, a number is out of range, or the first pose is out of reach.
            UnknownNameError: There is no such arm, link or column.
            MissingDependencyError: Pinocchio is not installed.
        """
        arm = self.arm(robot)
        acceleration = None if self.speed is None else self.speed / SPEEDING_UP
        trajectory = from_csv(path, speed=self.speed, acceleration=acceleration)
        return Scenario(
            name=f"{pathlib.Path(robot).stem}-{pathlib.Path(path).stem}",
            arm=arm,
            task=tasks.get("pose" if trajectory.has_orientation else "position"),
            trajectory=trajectory,
            dt=self.dt,
            steps=max(1, math.ceil(trajectory.duration / self.dt)),  # type: ignore[attr-defined]
        )


#: Options that have an effect with a URDF file alone, and those that a scenario file states itself.
URDF_OPTIONS = ("--base", "--tip", "--tool")
ROBOT_OPTIONS = (*URDF_OPTIONS, "--acceleration")
PATH_OPTIONS = (*ROBOT_OPTIONS, "--dt", "--speed")
