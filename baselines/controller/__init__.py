"""A policy on a real arm, without an environment: measurements go in, joint velocities come out."""

from __future__ import annotations

from baselines.controller.controller import Controller
from baselines.controller.drives import Drives
from baselines.controller.guards import Guards, StopReason
from baselines.controller.mock_arm import ArmInterface, MockArm, Reflex, State
from baselines.controller.timing import Timing, use_real_time_priority

__all__ = (
    "ArmInterface",
    "Controller",
    "Drives",
    "Guards",
    "MockArm",
    "Reflex",
    "State",
    "StopReason",
    "Timing",
    "use_real_time_priority",
)
