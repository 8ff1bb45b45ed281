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
    out = {name: scale(values[name], severity) for name in KNOWLEDGE}
    out |= {name: round(severity * values[name]) for name in ("q_delay", "pose_delay")}
    out["pose_every"] = whole(values["pose_every"], severity, least=1)
    return out | {"payload_step": values["payload_step"] if severity > 0.0 else 0}


def drives(values: Mapping[str, Any], severity: float) -> dict[str, Any]:
    """The fields of the drives at a severity.

    Args:
        values: The fields of a plant at severity 1.
        severity: Time constants, periods of resonances, backlash, bias, noise and the difference of gains from 1 grow
            with it in proportion, and delays, rounded to whole steps where they are whole.
    """
    out = {name: scale(values[name], severity) for name in DRIVES}
    if severity == 0.0:
        return out | {"command_delay": 0, "bandwidth": math.inf, "resonance": math.inf, "gain": 1.0}
    late = whole(values["command_delay"], severity)
    out |= {name: scale(values[name], 1.0 / severity) for name in ("bandwidth", "resonance")}
    return out | {"command_delay": late, "gain": scale(values["gain"], severity, 1.0)}


def whole(value: Any, factor: float, least: int = 0) -> Any:
    """A whole number, or each of a tuple of them, with its excess over the least one times a factor, rounded.

    Numbers with a fraction stay unrounded, as do those next to them.
    """
    if np.any(np.mod(value, 1.0)):
        return scale(value, factor, least)
    if isinstance(value, tuple):
        return tuple(whole(part, factor, least) for part in value)
    return least + round(factor * (value - least))


def scale(value: Any, factor: float, middle: float = 0.0) -> Any:
    """A number, or a tuple of numbers, with its difference from the middle times a factor."""
    if isinstance(value, tuple):
        return tuple(float(part) for part in middle + factor * (np.array(value) - middle))
    return middle + factor * (value - middle)
