"""The circle of docs/loop.py for arms that are in the catalogue, and for others."""

from __future__ import annotations

from pathlib import Path

import ikgym
from docs import loop

ROBOTS = Path(__file__).parents[2] / "robots"
#: Links and start of arms from URDF files.
ARMS = {
    "ur10": ("base_link", "tool0", (0.0, -1.5, 1.8, -1.9, -1.57, 0.0)),
    "baxter": ("torso", "left_gripper", (0.0, -0.55, 0.0, 1.28, 0.0, 0.3, 0.0)),
    "pr2": ("base_link", "r_gripper_tool_frame", (0.15, -0.3, 0.3, -1.0, -1.2, 0.0, -0.9, 0.0)),
}


def circle(name, dt=1e-3, seconds=2.0):
    """The scenario for an arm."""
    if name == "panda":
        arm = ikgym.arms.get("panda")
        return loop.circle(arm, arm.home, dt, seconds)
    base, tip, start = ARMS[name]
    return loop.circle(ikgym.arms.from_urdf(ROBOTS / f"{name}.urdf", base=base, tip=tip), start, dt, seconds)
