"""Scenarios: data, checks, seeds, and the values that PAPERS prescribes."""

import itertools

import numpy as np
import pytest

import ikgym
from ikgym import scenarios
from ikgym.exceptions import IkgymError, UnknownNameError
from ikgym.plant import Plant
from tests.every_scenario import every_scenario


@pytest.mark.parametrize("name", every_scenario())
def test_nominal_is_the_model_on_the_nominal_joint_path(name):
    scenario = scenarios.get(name).replace(steps=40)
    nominal = scenario.nominal(seed=3, preview=5)
    assert nominal.shape == (46, scenario.task.size)
    path = scenario.nominal_joint_path(seed=3, preview=5)
    if path is None:
        assert scenario.trajectory.joint_bound() is None
    else:
        poses = scenario.task.coordinates(*scenario.model.forward(path))
        np.testing.assert_array_equal(nominal, poses)
        assert scenario.shifts_start or np.array_equal(scenario.start_of(3), path[0])
        observation, _ = ikgym.RedundantIKEnv(scenario.replace(plant=ikgym.Plant())).reset(seed=3)
        np.testing.assert_array_equal(observation["q"], path[0])


def test_disturbance_moves_the_arm_as_said():
    scenario = scenarios.get("varga7-fast").replace(steps=400, plant=Plant(bias=0.5, noise=0.25))
    env = ikgym.RedundantIKEnv(scenario)
    before = env.reset(seed=3)[0]["q"]
    drifts = []
    for _ in range(400):
        observation = env.step(np.zeros(7, dtype=np.float32))[0]
        drifts.append((observation["q"] - before) / scenario.dt)
        before = observation["q"]
        np.testing.assert_array_equal(observation["qdot"], 0.0)
    drifts = np.array(drifts)
    assert abs(drifts - 0.5).max() <= 0.25 + 1e-9
    np.testing.assert_allclose(drifts.mean(axis=0), 0.5, atol=0.05)
    np.testing.assert_allclose(drifts.std(axis=0), 0.25 / 3**0.5, rtol=0.2)
    assert abs(np.corrcoef(drifts.T) - np.eye(7)).max() < 0.25


def test_replace():
    scenario = scenarios.get("varga7-fast")
    assert scenario.replace(steps=500).steps == 500
    assert scenario.steps == 3000
    other = scenario.replace(arm=ikgym.arms.get("varga7_literal"))
    assert other.model is other.arm
    twin = scenarios.get("khan8-q1").replace(arm=ikgym.arms.get("khan8_approximate"))
    assert twin.model.name == "khan8_approximate"
    with pytest.raises(UnknownNameError, match=r"Did you mean 'steps'"):
        scenario.replace(step=3)


def test_seed_ranges_are_disjoint():
    assert list(scenarios.SPLITS) == ["train", "validation", "test"]
    for one, other in itertools.combinations(scenarios.SPLITS.values(), 2):
        assert one.stop <= other.start or other.stop <= one.start
    assert scenarios.seeds("test", 3) == (2_000_000, 2_000_001, 2_000_002)
    for split, count in (("validaton", 3), ("test", 1_000_001), ("test", 0)):
        with pytest.raises(IkgymError):
            scenarios.seeds(split, count)
