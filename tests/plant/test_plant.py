"""The plant as data: what it refuses, and what it says of itself."""

import dataclasses

import ikgym
from baselines.fingerprints import fingerprint
from ikgym import Plant

SCENARIO = ikgym.scenarios.get("varga7-random").replace(steps=20)


ON = {
    "zero": 1e-3,
    "link": 1e-3,
    "axis": 1e-3,
    "payload": -1e-3,
    "arms": (ikgym.arms.get("varga7"),),
    "bandwidth": 20.0,
    "command_delay": 2,
    "backlash": 1e-4,
    "bias": -0.1,
    "noise": 0.1,
    "q_noise": 1e-5,
    "pose_noise": 1e-3,
    "pose_rotation_noise": 1e-3,
    "q_delay": 1,
    "pose_delay": 1,
    "pose_every": 2,
    "pose_missing": 0.1,
}


def test_each_effect_switches_the_plant_on():
    assert Plant().ideal
    assert Plant(payload_step=5).ideal
    assert repr(Plant()) == "Plant()"
    assert Plant(calibration=2.0, load=(1, 3)).ideal
    assert {*ON, "payload_step", "calibration", "load", "from_middle"} == {
        field.name for field in dataclasses.fields(Plant)
    }
    digests = {fingerprint(SCENARIO)}
    for name, value in ON.items():
        plant = Plant(**{name: value})
        assert not plant.ideal
        assert name in repr(plant)
        digests.add(fingerprint(SCENARIO.replace(plant=plant)))
    assert len(digests) == 1 + len(ON)


def test_what_is_drawn_is_random():
    drawn = {"zero", "link", "axis", "noise", "q_noise", "pose_noise", "pose_rotation_noise", "pose_missing"}
    assert {name for name, value in ON.items() if Plant(**{name: value}).random} == drawn
    assert {name for name, value in ON.items() if Plant(**{name: value}).draws_arm} == {"zero", "link", "axis"}
    assert {name for name, value in ON.items() if Plant(**{name: value}).late} == {
        "q_delay",
        "pose_delay",
        "pose_every",
        "pose_missing",
    }
    assert Plant(bandwidth=(10, 20)).draws_arm
    assert Plant(command_delay=(1, 2)).draws_arm
    assert Plant(pose_every=(1, 2)).draws_arm
    assert Plant(pose_every=(1, 2)).late
    assert Plant(pose_noise=(0, 1e-3)).noisy
    assert not Plant(command_delay=(2, 2), bandwidth=(3.0, 3.0)).random
    assert Plant(arms=2 * ON["arms"]).draws_arm
