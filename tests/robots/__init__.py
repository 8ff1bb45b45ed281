"""Arms that are not in the catalogue: a URDF file each, and a path of the same name."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from baselines.cli.own_path import OwnPath, scenario_of

FOLDER = Path(__file__).parent


class Robot(NamedTuple):
    """A chain of a URDF file, the speed of its tool in [m/s] on its path, and what `ikgym compare` recommends there."""

    base: str
    tip: str
    speed: float
    recommended: str

    def scenario(self, name):
        """Its scenario; accelerations of at most 5 rad/s² or m/s²."""
        arm, path = (str(FOLDER / f"{name}.{ending}") for ending in ("urdf", "csv"))
        options = {"arm": arm, "base": self.base, "tip": self.tip, "speed": self.speed}
        return scenario_of(OwnPath(path, acceleration=(5.0,), **options))


ROBOTS = {
    "ur10": Robot("base_link", "tool0", 1.0, "qp on the retimed path"),
    "ur10_rail": Robot("world", "tool0", 0.2, "sns"),
    "baxter": Robot("torso", "left_gripper", 0.8, "qp on the retimed path"),
    "pr2": Robot("base_link", "r_gripper_tool_frame", 0.5, "qp"),
}
