"""The spaces of a scenario, with bounds that are finite and true."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from ikgym.kernels.random_numbers import CUT
from ikgym.plant.response import deflection
from ikgym.scenarios import Scenario
from ikgym.scenarios.preview import Preview, offsets
from ikgym.validation import FloatArray

# Rounding of sums over an episode and of products of rotations must not leave the box.
SLACK = 1.0 + 1e-9


def action_space(scenario: Scenario) -> spaces.Box:
    """Joint velocities as fractions of the scenario's velocity limit. Shape (n,)."""
    return spaces.Box(-1.0, 1.0, (scenario.joints,), np.float32)


def observation_space(scenario: Scenario, preview: Preview, commands: int = 0) -> spaces.Dict:
    """The observation space; its bounds follow from start, limits, number of steps and reach.

    Boxes of float64: q (n,), qdot (n,), pose (m,), nominal (p, m), remaining (1,); where sensors are slow or late q_age
    (1,) and pose_age (1,); where h commands are shown commands (h, n), and where obstacles move or differ from episode
    to episode obstacles (o, 16).
    """
    ahead = offsets(preview)
    q = SLACK * scenario.joint_bound()
    plant = scenario.plant
    noise = CUT * np.asarray(plant.q_noise) + deflection(plant, scenario.velocity_limit, scenario.dt)
    pose = _coordinate_bound(scenario, plant.reach(scenario.arm, q) + CUT * float(np.max(plant.pose_noise)))
    if scenario.initial_pose is not None:
        pose = np.maximum(pose, np.abs(scenario.initial_pose))
    times = scenario.times(int(scenario.points(preview)[-1]) + 1)
    nominal = _coordinate_bound(scenario, scenario.trajectory.reach(times, scenario.model))
    lower, upper = np.maximum(-q, scenario.arm.lower) - noise, np.minimum(q, scenario.arm.upper) + noise
    ages, past = {}, {}
    if plant.late:
        ages["q_age"] = spaces.Box(0.0, float(max(plant.q_delay, 1)), (1,), np.float64)
        ages["pose_age"] = spaces.Box(0.0, float(scenario.steps), (1,), np.float64)
    if scenario.obstacles_shown:
        past["obstacles"] = _box_between(*scenario.obstacle_bounds())
    if commands:
        past["commands"] = _box(np.tile(scenario.largest_qdot, (commands, 1)))
    return spaces.Dict(
        {
            "q": spaces.Box(lower, upper, dtype=np.float64),
            "qdot": _box(scenario.largest_qdot),
            "pose": _box(pose),
            "nominal": _box(np.tile(nominal, (len(ahead), 1))),
            "remaining": spaces.Box(0.0, float(scenario.steps), (1,), np.float64),
            **ages,
            **past,
        }
    )


def _coordinate_bound(scenario: Scenario, reach: float) -> FloatArray:
    """Bounds of task coordinates: 1 for parts of a rotation, the reach for positions. Shape (m,)."""
    return SLACK * np.array([1.0] * (scenario.task.size - 3) + [reach] * 3)


def _box_between(low: FloatArray, high: FloatArray) -> spaces.Box:
    return spaces.Box(low - 1e-9, high + 1e-9, dtype=np.float64)


def _box(bound: FloatArray) -> spaces.Box:
    return spaces.Box(-bound, bound, dtype=np.float64)
