"""The chain of a robot of one's own, as options that several commands have."""

from __future__ import annotations

import dataclasses
from typing import Annotated

import tyro

from ikgym import arms
from ikgym.arms import Arm
from ikgym.validation import per_joint


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

    def robot(self, name: str) -> Arm:
        """The arm of a URDF file, or of the catalogue by its name."""
        urdf = name.endswith(".urdf")
        return self.accelerated(
            arms.from_urdf(name, base=self.base, tip=self.tip, tool=self.tool) if urdf else arms.get(name)
        )

    def accelerated(self, arm: Arm) -> Arm:
        """The arm with the acceleration limits that are given; the same where none are."""
        if not self.acceleration:
            return arm
        limit = self.acceleration[0] if len(self.acceleration) == 1 else self.acceleration
        return arm.replace(acceleration_limit=per_joint("--acceleration", limit, arm.joints))


#: The names of these options.
ROBOT_OPTIONS = ("--base", "--tip", "--tool", "--acceleration")
