"""The plant as data: what it refuses, and what it says of itself."""

import dataclasses

from baselines.fingerprints import fingerprint
from ikgym import Plant
from tests.plant.effects import EFFECTS, panda

ON = {name: Plant(**effect) for name, effect in EFFECTS.items()}


def test_each_effect_switches_the_plant_on():
    assert Plant().ideal
    assert Plant(payload_step=5).ideal
    assert repr(Plant()) == "Plant()"
    assert Plant(calibration=2.0, load=(1, 3)).ideal
    without_effect = {"payload_step", "delay_margin", "resonance_damping", "calibration", "load", "from_middle"}
    assert {*ON, *without_effect} == {field.name for field in dataclasses.fields(Plant)}
    for name, plant in ON.items():
        assert not plant.ideal
        assert name in repr(plant)
    assert len({fingerprint(panda(plant)) for plant in (Plant(), *ON.values())}) == 1 + len(ON)


def test_what_is_drawn_is_random():
    draws_arm = {"zero", "link", "axis", "arms", "bandwidth", "command_delay"}
    noise = {"noise", "q_noise", "pose_noise", "pose_rotation_noise", "pose_missing"}
    assert {name for name, plant in ON.items() if plant.random} == draws_arm | noise
    assert {name for name, plant in ON.items() if plant.draws_arm} == draws_arm
    assert {name for name, plant in ON.items() if plant.late} == {"q_delay", "pose_delay", "pose_every", "pose_missing"}
    assert Plant(pose_every=(1, 2)).draws_arm
    assert Plant(pose_every=(1, 2)).late
    assert Plant(pose_noise=(0, 1e-3)).noisy
    assert not Plant(command_delay=(2, 2), bandwidth=(3.0, 3.0)).random


def test_at_its_margin_a_plant_is_later():
    assert Plant(delay_margin=1.0).ideal
    assert Plant(command_delay=(0.5, 2, 3), delay_margin=1.0).at_margin() == Plant(command_delay=(1.5, 3, 4))
    assert Plant(command_delay=(2, 5), delay_margin=1.0).at_margin() == Plant(command_delay=(3, 6))
