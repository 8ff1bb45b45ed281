"""Scenarios whose plant is not the model: calibration, camera, drives, and all of it, on gentle paths of the Panda.

All of them have the paths of `panda-ideal`: seeds draw the same ones, and the same arms where the kinematics differ
equally much. Tracking errors outweigh velocities in the cost: on an arm with the errors of `panda-camera`, a policy
that trusts the data sheet pays some tens of times what it pays on an ideal plant.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from ikgym import arms, tasks
from ikgym.cost import TrackingCost
from ikgym.plant import Plant
from ikgym.scenarios.scenario import Scenario
from ikgym.trajectories import RandomJointSpline

#: Δt in [s], and how long the paths take, from rest to rest, in [s].
DT, DURATION = 1e-3, 3.0
STEPS = round(DURATION / DT)
# So far from home are the paths at most, in [rad]; the fastest and hardest that a joint moves, in [rad/s] and [rad/s²].
AROUND_HOME, SPEED, ACCELERATION = 1.0, 1.0, 4.0
#: Pandas whose kinematics others have measured.
CALIBRATED = ("panda-2", "panda-3", "panda-4", "panda-6", "panda-7")
#: Calibration that is left over after a careful one: joint zeros and axes in [rad], links in [m].
CALIBRATION: dict[str, Any] = {"zero": 5e-4, "link": 3e-4, "axis": 5e-4}
#: A camera of some 60 Hz, and a slow one of 30 Hz: position in [m], orientation in [rad].
CAMERA: dict[str, Any] = {"pose_every": 17, "pose_noise": 3e-4, "pose_rotation_noise": 5e-4, "pose_missing": 0.1}
SLOW_CAMERA: dict[str, Any] = {"pose_every": 33, "pose_noise": 1e-3, "pose_rotation_noise": 1e-3, "pose_missing": 0.2}
#: Velocity loops of 10 to 20 Hz behind a bus, whose delay of 2 to 12 steps nobody states.
BUS: dict[str, Any] = {"bandwidth": (10.0, 20.0), "command_delay": (2, 12)}
#: All of it at severity 1; at 0.5 the calibration is that of the others.
FIELD = Plant(
    zero=1e-3, link=6e-4, axis=1e-3, payload=1e-3, payload_step=STEPS // 2, **SLOW_CAMERA, **BUS
)  # fmt: skip
#: The scenario with that plant, and its severity.
FIELD_NAME, SEVERITY = "panda-field", 0.5


def field(knowledge: float = SEVERITY, drives: float | None = None) -> Scenario:
    """`panda-field` at other severities: calibration, payload, camera, lag and delay at once.

    Args:
        knowledge: How bad calibration and camera are, see :meth:`ikgym.Plant.scaled`; 0 is ideal, 1 the worst.
        drives: Likewise lag and delay of the drives; as bad as the knowledge if left out.

    Raises:
        InvalidInputError: A severity is below 0.
    """
    return _imperfect(FIELD_NAME, FIELD.scaled(knowledge, drives))


def _imperfect(name: str, plant: Plant) -> Scenario:
    arm = arms.get("panda")
    home = arm.home
    assert home is not None  # the catalogue of arms says so
    lower, upper = np.maximum(arm.lower, home - AROUND_HOME), np.minimum(arm.upper, home + AROUND_HOME)
    limits = {"velocity_limit": SPEED, "acceleration_limit": ACCELERATION}
    return Scenario(
        name,
        arm,
        tasks.get("pose"),
        RandomJointSpline.within(arm, DURATION, lower=lower, upper=upper, scale=(0.5, 1.0), **limits),
        cost=TrackingCost(p_x=2.0),
        dt=DT,
        steps=STEPS,
        plant=plant,
        source="random motion of this project" + (", plant of this project" if not plant.ideal else ""),
    )


def _measured() -> Scenario:
    """Five Pandas that others have calibrated move; solvers know the data sheet."""
    return _imperfect("panda-measured", Plant(arms=tuple(map(arms.get, CALIBRATED))))


_PLANTS: dict[str, dict[str, Any]] = {
    "panda-ideal": {},
    "panda-camera": CALIBRATION | CAMERA,
    "panda-camera-slow": CALIBRATION | SLOW_CAMERA,
    # The same; its test set is of sequences of five episodes of one arm.
    "panda-same-arm": CALIBRATION | SLOW_CAMERA,
    # A payload or a slip of 1 mrad in every joint, half-way.
    "panda-payload": {"payload": 1e-3, "payload_step": STEPS // 2},
    "panda-bus": BUS,
}

SCENARIOS: dict[str, Callable[[], Scenario]] = {
    name: functools.partial(lambda name, given: _imperfect(name, Plant(**given)), name, given)
    for name, given in _PLANTS.items()
} | {"panda-measured": _measured, FIELD_NAME: field}
