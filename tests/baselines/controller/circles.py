"""A circle of 0.1 m at 0.1 m/s for arms that are in the catalogue, and for others."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import baselines
import ikgym
from ikgym.trajectories.orientations import FixedOrientation
from ikgym.trajectories.path_trajectory import PathTrajectory
from ikgym.trajectories.paths import Circle
from ikgym.trajectories.time_laws import Trapezoidal

ROBOTS = Path(__file__).parents[2] / "robots"
#: Links and start of arms from URDF files.
ARMS = {
    "ur10": ("base_link", "tool0", (0.0, -1.5, 1.8, -1.9, -1.57, 0.0)),
    "baxter": ("torso", "left_gripper", (0.0, -0.55, 0.0, 1.28, 0.0, 0.3, 0.0)),
    "pr2": ("base_link", "r_gripper_tool_frame", (0.15, -0.3, 0.3, -1.0, -1.2, 0.0, -0.9, 0.0)),
}
#: In its frame, x is the direction from the center to the start; the axis is x of the base.
UPRIGHT = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
RADIUS, SPEED, ACCELERATION = 0.1, 0.1, 0.5


def circle(name, dt=1e-3, seconds=2.0, **changes):
    """A scenario whose tool goes upright on a circle, from where the arm stands."""
    arm, q = ikgym.arms.get("panda"), None
    if name == "panda":
        q = arm.home
    else:
        base, tip, q = ARMS[name]
        arm = ikgym.arms.from_urdf(ROBOTS / f"{name}.urdf", base=base, tip=tip)
    rotation, position = arm.forward(np.array(q))
    path = Circle(position - RADIUS * UPRIGHT[:, 0], RADIUS, rotation=UPRIGHT)
    trajectory = PathTrajectory(path, Trapezoidal(SPEED, ACCELERATION), FixedOrientation(rotation))
    fields = {"dt": dt, "steps": round(seconds / dt), "start": q, "velocity_limit": None, **changes}
    return ikgym.Scenario(f"{name}-circle", arm, ikgym.tasks.get("pose"), trajectory, **fields)


def with_drives(scenario, delay, time_constant):
    """The same on drives with a delay in steps and a lag in [s]."""
    bandwidth = np.inf if time_constant is None else 1.0 / (2.0 * np.pi * time_constant)
    return scenario.replace(plant=ikgym.Plant(command_delay=delay, bandwidth=bandwidth))


def looped(controller, scenario):
    """Plays a scenario by a controller: position errors in [m], and commands. Shapes (k,) and (k, n)."""
    env = ikgym.RedundantIKEnv(scenario, preview=controller.ahead)
    seen, _ = env.reset(seed=0)
    errors, commands = np.empty(scenario.steps), np.empty((scenario.steps, scenario.joints))
    for k in range(scenario.steps):
        commands[k] = controller.step(seen["q"], seen["pose"], seen["nominal"])
        seen, *_, info = env.step((commands[k] / scenario.velocity_limit).astype(np.float32))
        errors[k] = info["position_error"]
    return errors, commands


def peaks(scenario, policy="qp"):
    """The largest joint velocities on perfect drives, in [rad/s] or [m/s]. Shape (n,)."""
    return np.abs(baselines.track(scenario, policy).qdot).max(axis=0)
