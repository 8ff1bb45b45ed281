"""Policies that adapt on plants that are drawn: calibration errors behind a camera."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import baselines
import ikgym
from ikgym import Plant

BASE = {"policy": "rhc", "options": {"horizon": 3}}


@functools.cache
def tracked(name, late):
    """Tracking cost of the second half of a short episode; the first is that of the start."""
    camera = {"pose_every": 17, "pose_delay": 5, "pose_missing": 0.1} if late else {}
    noise = {"pose_noise": 3e-4, "pose_rotation_noise": 3e-4}
    plant = Plant(zero=1e-3, link=6e-4, axis=1e-3, **noise, **camera)
    on = ikgym.scenarios.get("panda-random").replace(dt=1e-3, steps=160, plant=plant)
    parameters = BASE["options"] if name == "rhc" else BASE
    return np.mean([baselines.track(on, (name, parameters), seed=seed).tracking_cost[80:].sum() for seed in (1, 2)])


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("name", ["offset_free", "calibrated"])
def test_the_offset_of_a_wrong_arm_is_taken_back(name, late):
    """Of a base policy that only reads joint coordinates, behind a camera that is noisy, slow, late, and has gaps."""
    assert tracked(name, late) < 0.15 * tracked("rhc", late)
