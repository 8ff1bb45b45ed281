"""Arms that are stopped where bodies touch; that all ways of simulation agree is in test_proximity.py."""

import gymnasium as gym
import numpy as np
import pytest

import ikgym
from ikgym.obstacles import Sphere
from ikgym.plant import Plant
from tests.bodied import AROUND, crowd, line, wild

CROWD = crowd(1000)
#: Leads the arm into the floor.
DOWN = np.array([0, 1, 0, 0, 0, 0, 0], dtype=np.float32)


def test_bodies_belong_to_the_arm_that_moves():
    plant = Plant(zero=0.02, link=5e-3, axis=0.02, payload=0.02, payload_step=15)
    drawn = crowd(1000, AROUND[:2]).replace(plant=plant)
    env = gym.make("RedundantIK-v0", scenario=drawn)
    env.reset(seed=4)
    moved, lengths = drawn.drawn_plant(4), np.linalg.norm(drawn.arm.bodies.ends, axis=1)
    for k, action in enumerate(wild(1, 30)[:, 0], start=1):
        seen, _, _, _, info = env.step(action)
        arm = moved.loaded_arm if k >= 15 else moved.arm
        assert not info["collision"]
        assert info["clearance"] == pytest.approx(arm.clearance(seen["q"], drawn.obstacles)[0], abs=1e-12)
        np.testing.assert_allclose(np.linalg.norm(arm.bodies.ends, axis=1), lengths, rtol=0, atol=1e-12)


def test_an_arm_that_is_stopped_pays_to_the_end():
    env = gym.make("RedundantIK-v0", scenario=CROWD)
    env.reset(seed=1)
    rewards, collided = [], []
    for _ in range(CROWD.steps):
        _, reward, _, over, info = env.step(DOWN)
        rewards.append(reward)
        collided.append(info["collision"])
    assert over
    first = collided.index(True)
    assert all(collided[first:])
    assert max(rewards[first:]) < 0.0


def test_obstacles_are_shown_as_they_will_be_after_the_step():
    passing = crowd(1000, [Sphere("ball", [-1, 0, 1], 0.1, motion=line([0.4, 0, 0], 0.4))])
    env = gym.make("RedundantIK-v0", scenario=passing)
    seen, _ = env.reset(seed=0)
    rows = passing.obstacle_rows(passing.steps + 2)
    np.testing.assert_array_equal(seen["obstacles"], rows[1])
    assert env.observation_space.contains(seen)
    seen = env.step(np.zeros(7, dtype=np.float32))[0]
    np.testing.assert_array_equal(seen["obstacles"], rows[2])


def test_a_thing_that_moves_into_an_arm_stops_it():
    coming = crowd(1000, [Sphere("ball", [-0.6, 0, 0.6], 0.1, motion=line([1.2, 0, 0], 0.4))])
    env = gym.make("RedundantIK-v0", scenario=coming)
    env.reset(seed=0)
    infos = [env.step(np.zeros(7, dtype=np.float32))[4] for _ in range(coming.steps)]
    assert infos[-1]["collision"]
    assert not infos[0]["collision"]


def test_without_collisions_nothing_is_stopped_and_costs_are_the_same():
    bare = ikgym.scenarios.get("panda-circle").replace(steps=1000)
    rewards = []
    for one in (bare, CROWD.replace(collisions=False), crowd(1000, [Sphere("far", [50, 0, 0], 0.1)])):
        env = gym.make("RedundantIK-v0", scenario=one)
        env.reset(seed=2)
        rewards.append([env.step(action)[1] for action in wild(1, 100)[:, 0]])
    assert rewards[0] == rewards[1] == rewards[2]


def test_learners_are_ended_by_a_collision():
    env = gym.make("RedundantIK-v0", scenario=CROWD, lost_distance=5.0)
    envs = ikgym.RedundantIKVectorEnv(2, CROWD, lost_distance=5.0)
    env.reset(seed=1)
    envs.reset(seed=1)
    for _ in range(CROWD.steps):
        _, _, terminated, _, info = env.step(DOWN)
        assert terminated == info["collision"]
        assert envs.step(np.stack([DOWN] * 2))[2].tolist() == [terminated] * 2
        if terminated:
            break
    assert terminated
