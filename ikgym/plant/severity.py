"""Plants at other severities."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

#: Fields that grow in proportion: deviations and noises of arm and sensors, and those of the drives.
KNOWLEDGE = ("zero", "link", "axis", "payload", "q_noise", "pose_noise", "pose_rotation_noise", "pose_missing")
DRIVES = ("backlash", "bias", "noise")


def knowledge(values: Mapping[str, Any], severity: float) -> dict[str, Any]:
    """The fields of calibration, payload and sensors at a severity.

    Args:
        values: The fields of a plant at severity 1.
        severity: Deviations, noises and the share of lost measurements grow with it in proportion; so do, rounded to
            whole steps, delays, and the steps by which measurements are further apart than one.
    """
    out = {name: scaled(values[name], severity) for name in KNOWLEDGE}
    out |= {name: round(severity * values[name]) for name in ("q_delay", "pose_delay")}
    payload_step = values["payload_step"] if severity > 0.0 else 0
    return out | {"pose_every": 1 + round(severity * (values["pose_every"] - 1)), "payload_step": payload_step}


def drives(values: Mapping[str, Any], severity: float) -> dict[str, Any]:
    """The fields of the drives at a severity.

    Args:
        values: The fields of a plant at severity 1.
        severity: Time constants, backlash, bias and noise grow with it in proportion, and delays, rounded to whole
            steps.
    """
    out = {name: scaled(values[name], severity) for name in DRIVES}
    if severity == 0.0:
        return out | {"command_delay": 0, "bandwidth": math.inf}
    delay = values["command_delay"]
    late = tuple(round(severity * end) for end in delay) if isinstance(delay, tuple) else round(severity * delay)
    return out | {"command_delay": late, "bandwidth": scaled(values["bandwidth"], 1.0 / severity)}


def scaled(value: Any, factor: float) -> Any:
    """A number, or a tuple of numbers, times a factor."""
    return tuple(float(part) for part in factor * np.array(value)) if isinstance(value, tuple) else factor * value
