"""Arms that are stopped where bodies touch; that all ways of simulation agree is in test_proximity.py."""

import gymnasium as gym
import numpy as np
import pytest

import ikgym
from ikgym.arms.bodies import Bodies
from ikgym.obstacles import Box, Capsule, HalfSpace, Sphere
from ikgym.plant import Plant
from ikgym.trajectories import StraightLine

LINKS = Bodies(
    names=["upper", "lower", "tool"],
    links=[2, 4, 7],
    starts=[[0, 0, 0.05], [0, 0, 0.05], [0, 0, -0.05]],
    ends=[[0, 0, 0.3], [-0.08, 0, 0.38], [0, 0, -0.107]],
    radii=[0.06, 0.05, 0.04],
    ignored=[["lower", "upper"]],
)
OBSTACLES = [
    HalfSpace("floor", [0, 0, -0.2], [0.1, 0, 1]),
    Box("box", [0.75, 0.2, 0.5], [0.2, 0.1, 0.3], rotation=ikgym.arms.get("panda").tool_rotation),
    Sphere("ball", [0.2, -0.6, 0.5], 0.1),
    Capsule("post", [-0.5, 0.3, 0.0], [-0.5, 0.3, 1.0], 0.05),
]


def among(*others):
    """A Panda among all kinds of obstacles, and others."""
    base = ikgym.scenarios.get("panda-circle")
    obstacles = [*OBSTACLES, *others]
    return base.replace(name="crowd", arm=base.arm.replace(bodies=LINKS), obstacles=obstacles, steps=1000)


def person():
    return Capsule("person", [0, 0.5, 0], [0, 0.5, 1], 0.1, motion=line([0.4, -0.3, 0], 0.5))


@pytest.fixture(scope="module")
def scenario():
    return among()


def line(way, duration):
    """A motion from the base frame along a straight line."""
    upright = np.eye(3).ravel()
    return StraightLine([*upright, 0, 0, 0], [*upright, *way], duration=duration, blend=0.1)


def wild(rows, steps, seed=0):
    """Actions that lead joints somewhere, one arm another way than the next."""
    rng = np.random.default_rng(seed)
    drift = rng.uniform(-1, 1, (1, rows, 7))
    return np.clip(drift + 0.3 * rng.normal(size=(steps, rows, 7)), -1, 1).astype(np.float32)


def vectors_of(scenario):
    """Native and synchronous environments of five arms."""
    modes = ("vector_entry_point", "sync")
    return [gym.make_vec("RedundantIK-v0", num_envs=5, scenario=scenario, vectorization_mode=mode) for mode in modes]


def test_bodies_belong_to_the_arm_that_moves(scenario):
    plant = Plant(zero=0.02, link=5e-3, axis=0.02, payload=0.02, payload_step=15)
    drawn = scenario.replace(plant=plant, obstacles=OBSTACLES[1:2])
    env = gym.make("RedundantIK-v0", scenario=drawn)
    seen, _ = env.reset(seed=4)
    moved = drawn.drawn_plant(4)
    for k, action in enumerate(wild(1, 30)[:, 0], start=1):
        seen, _, _, _, info = env.step(action)
        arm = moved.loaded_arm if k >= 15 else moved.arm
        assert not info["collision"]
        assert info["clearance"] == pytest.approx(arm.clearance(seen["q"], drawn.obstacles)[0], abs=1e-12)
        ends, tool = arm.bodies.ends, drawn.arm.tool
        assert np.linalg.norm(ends[-1]) == pytest.approx(np.linalg.norm(tool), abs=1e-12)


def test_an_arm_that_is_stopped_pays_to_the_end(scenario):
    env = gym.make("RedundantIK-v0", scenario=scenario)
    env.reset(seed=1)
    rewards, collided = [], []
    for _ in range(scenario.steps):
        _, reward, _, over, info = env.step(np.array([0, 1, 0, 0, 0, 0, 0], dtype=np.float32))
        rewards.append(reward)
        collided.append(info["collision"])
    assert over
    first = collided.index(True)
    assert all(collided[first:])
    assert max(rewards[first:]) < 0.0


def test_obstacles_are_shown_as_they_will_be_after_the_step(scenario):
    way = line([0.4, 0, 0], 0.4)
    crowd = scenario.replace(obstacles=[Sphere("ball", [-1, 0, 1], 0.1, motion=way)])
    env = gym.make("RedundantIK-v0", scenario=crowd)
    seen, _ = env.reset(seed=0)
    rows = crowd.obstacle_rows(crowd.steps + 2)
    np.testing.assert_array_equal(seen["obstacles"], rows[1])
    assert env.observation_space.contains(seen)
    seen = env.step(np.zeros(7, dtype=np.float32))[0]
    np.testing.assert_array_equal(seen["obstacles"], rows[2])


def test_a_thing_that_moves_into_an_arm_stops_it(scenario):
    way = line([1.2, 0, 0], 0.4)
    crowd = scenario.replace(obstacles=[Sphere("ball", [-0.6, 0, 0.6], 0.1, motion=way)])
    env = gym.make("RedundantIK-v0", scenario=crowd)
    env.reset(seed=0)
    infos = [env.step(np.zeros(7, dtype=np.float32))[4] for _ in range(crowd.steps)]
    assert infos[-1]["collision"]
    assert not infos[0]["collision"]


def test_without_collisions_nothing_is_stopped_and_costs_are_the_same(scenario):
    free, bare = (
        scenario.replace(obstacles=(), collisions=False),
        ikgym.scenarios.get("panda-circle").replace(steps=1000),
    )
    far = scenario.replace(obstacles=[Sphere("far", [50, 0, 0], 0.1)])
    far = far.replace(
        arm=far.arm.replace(
            bodies=far.arm.bodies.replace(ignored=[["tool", "upper"], ["tool", "lower"], ["lower", "upper"]])
        )
    )
    rewards = []
    for one in (free, bare, far):
        env = gym.make("RedundantIK-v0", scenario=one)
        env.reset(seed=2)
        rewards.append([env.step(action)[1] for action in wild(1, 100)[:, 0]])
    assert rewards[0] == rewards[1] == rewards[2]


def test_a_learner_is_ended_by_a_collision(scenario):
    env = gym.make("RedundantIK-v0", scenario=scenario, lost_distance=5.0)
    env.reset(seed=1)
    for _ in range(scenario.steps):
        _, _, terminated, _, info = env.step(np.array([0, 1, 0, 0, 0, 0, 0], dtype=np.float32))
        assert terminated == info["collision"]
        if terminated:
            break
    assert terminated
