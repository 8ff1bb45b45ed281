"""The plant as data: what it refuses, and what it says of itself."""

from __future__ import annotations

import copy
import dataclasses
import math
import pickle

import numpy as np
import pytest

import ikgym
from baselines.fingerprints import fingerprint
from ikgym import Plant
from ikgym.exceptions import InvalidInputError, UnknownNameError

SCENARIO = ikgym.scenarios.get("varga7-random").replace(steps=20)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        *(({name: -1e-3}, f"{name}: expected a .*number (of at least|from) 0") for name in ("zero", "link", "axis")),
        *(({name: -1.0}, f"{name}: expected a number of at least 0") for name in ("backlash", "noise", "q_noise")),
        ({"pose_noise": -1.0}, "pose_noise: expected a finite number from 0"),
        ({"pose_rotation_noise": math.nan}, "pose_rotation_noise: expected a finite number from 0 .*, got nan"),
        ({"payload": math.inf}, "payload: expected finite numbers"),
        ({"payload_step": -1}, "payload_step: expected a whole number of at least 0, got -1"),
        ({"payload_step": 2.5}, r"payload_step: expected a whole number of at least 0, got 2\.5"),
        ({"bandwidth": 0.0}, r"bandwidth: expected a finite number above 0 .*, got 0\.0"),
        ({"bandwidth": (20, 10)}, r"bandwidth: expected a range \(low, high\) with low <= high, got \(20, 10\)"),
        ({"bandwidth": (10, math.inf)}, "bandwidth: expected a finite number above 0 .*, got inf"),
        ({"bandwidth": (1, 2, 3)}, r"bandwidth: expected one number or a range \(low, high\) of numbers above 0"),
        ({"bandwidth": "fast"}, "bandwidth: expected a finite number above 0 .*, got 'fast'"),
        ({"command_delay": (12, 2)}, r"command_delay: expected a range \(low, high\) with low <= high, got \(12, 2\)"),
        ({"command_delay": -1}, "command_delay: expected a whole number of at least 0, got -1"),
        ({"command_delay": (1.5, 2)}, r"command_delay: expected a whole number of at least 0, got 1\.5"),
        ({"q_delay": 0.5}, r"q_delay: expected a whole number of at least 0, got 0\.5"),
        ({"pose_delay": -2}, "pose_delay: expected a whole number of at least 0, got -2"),
        ({"pose_every": 0}, "pose_every: expected a whole number of at least 1, got 0"),
        ({"pose_missing": 1.01}, r"pose_missing: expected a finite number from 0 to 1, got 1\.01"),
        ({"pose_missing": -0.1}, r"pose_missing: expected a finite number from 0 to 1, got -0\.1"),
        ({"arms": "panda-2"}, "arms: expected a sequence of arms, got 'panda-2'"),
        ({"arms": ("panda-2",)}, r"arms: expected a sequence of arms, got \('panda-2',\)"),
    ],
)
def test_bad_plants(values, message):
    with pytest.raises(InvalidInputError, match=message):
        Plant(**values)


@pytest.mark.parametrize(
    ("plant", "message"),
    [
        (Plant(zero=(1.0, 2.0)), r"zero: expected shape \(7,\), got \(2,\)"),
        (Plant(command_delay=21), "command_delay: expected at most the 20 steps of the episode, got 21"),
        (Plant(command_delay=(3, 21)), r"command_delay: expected at most the 20 steps .*, got \(3, 21\)"),
        (Plant(q_delay=21), "q_delay: expected at most the 20 steps"),
        (Plant(pose_delay=21), "pose_delay: expected at most the 20 steps"),
        (Plant(arms=(ikgym.arms.get("faitli3"),)), "arms: expected 7 joints of the kinds that arm 'varga7' has"),
        (Plant(arms=(ikgym.arms.get("panda"),)), "got 'panda' with prismatic="),
        (None, "plant of scenario 'varga7-random': expected Plant, got None"),
    ],
)
def test_plants_that_do_not_suit_a_scenario(plant, message):
    with pytest.raises(InvalidInputError, match=message):
        SCENARIO.replace(plant=plant)


def test_unknown_fields_have_a_suggestion():
    with pytest.raises(UnknownNameError, match=r"no field of Plant 'pose_evry'\. Did you mean 'pose_every'"):
        Plant().replace(pose_evry=3)


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
    assert {*ON, "payload_step"} == {field.name for field in dataclasses.fields(Plant)}
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
    assert not Plant(command_delay=(2, 2), bandwidth=(3.0, 3.0)).random
    assert Plant(arms=2 * ON["arms"]).draws_arm


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda plant: pickle.loads(pickle.dumps(plant))])
def test_copies(copied):
    plant = Plant(**{**ON, "arms": ()}, payload_step=3)
    assert copied(plant) == plant
    assert plant.replace(zero=0.0) != plant


def test_arrays_are_kept_as_tuples():
    plant = Plant(zero=np.arange(3.0), command_delay=[1, 2], bandwidth=np.array([3.0, 4.0]))
    assert plant.zero == (0.0, 1.0, 2.0)
    assert plant.command_delay == (1, 2)
    assert plant.bandwidth == (3.0, 4.0)
    assert type(plant.command_delay[0]) is int
