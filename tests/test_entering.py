"""Episodes that are entered after some steps, and that end where the track is lost."""

import gymnasium as gym
import numpy as np
import pytest

import ikgym
from ikgym.exceptions import InvalidInputError

SCENARIOS = ("varga7-random", "panda-random", "varga7-fast")


@pytest.mark.parametrize("name", SCENARIOS)
def test_an_episode_is_entered_on_its_joint_path(name):
    scenario = ikgym.scenarios.get(name)
    env = ikgym.RedundantIKEnv(scenario, preview=2)
    observation, _ = env.reset(seed=4, options={"step": 250})
    path = scenario.nominal_joint_path(4)
    nominal = scenario.nominal(4, preview=2)
    assert np.array_equal(observation["q"], path[250])
    assert np.allclose(observation["qdot"], (path[250] - path[249]) / scenario.dt, rtol=0.0, atol=1e-9)
    assert np.array_equal(observation["nominal"], nominal[251:253])
    assert observation["remaining"] == scenario.steps - 250
    assert env.observation_space.contains(observation)
    *_, info = env.step(env.action_space.sample())
    assert info["time"] == 251 * scenario.dt


def test_rows_enter_one_by_one():
    envs = gym.make_vec("RedundantIK-v0", num_envs=3, scenario="varga7-random")
    observation, _ = envs.reset(seed=0, options={"step": [None, 5, 900]})
    assert observation["remaining"].ravel().tolist() == [1000, 995, 100]
    observation, _ = envs.reset(options={"step": 7, "reset_mask": np.array([True, False, True])})
    assert observation["remaining"].ravel().tolist() == [993, 995, 993]


def test_sensors_and_drives_remember_the_arm_as_it_is():
    """With everything late and slow, what is seen at the entry is the arm there, and not where episodes begin."""
    plant = ikgym.Plant(q_delay=3, pose_delay=7, pose_every=5)
    scenario = ikgym.scenarios.get("panda-random").replace(plant=plant)
    env = ikgym.RedundantIKEnv(scenario, preview=2, commands=2)
    observation, _ = env.reset(seed=2, options={"step": 301})
    q = scenario.nominal_joint_path(2)[301]
    rotation, position = scenario.arm.forward(q)
    assert np.array_equal(observation["q"], q)
    assert np.allclose(observation["pose"], scenario.task.coordinates(rotation, position), rtol=0.0, atol=1e-12)
    assert np.array_equal(observation["commands"], np.tile(observation["qdot"], (2, 1)))


def test_a_start_of_ones_own_is_entered_at_rest():
    scenario = ikgym.scenarios.get("varga7-random")
    env = ikgym.RedundantIKEnv(scenario)
    observation, _ = env.reset(seed=0, options={"step": 10, "q": np.zeros(7)})
    assert not observation["q"].any()
    assert not observation["qdot"].any()
    assert observation["remaining"] == scenario.steps - 10


def test_a_lost_track_ends_the_episode():
    env = ikgym.RedundantIKEnv("varga7-random", lost_distance=0.05)
    env.reset(seed=0)
    lost = False
    while not lost:
        _, _, lost, over, info = env.step(np.ones(7, dtype=np.float32))
        assert not over
    assert info["position_error"] > 0.05
    with pytest.raises(ikgym.exceptions.ResetNeededError, match="has ended"):
        env.step(np.ones(7, dtype=np.float32))
    assert env.reset()[0]["remaining"] == 1000
    with pytest.raises(InvalidInputError, match="lost_distance"):
        ikgym.RedundantIKEnv("varga7-random", lost_distance=-1.0)
