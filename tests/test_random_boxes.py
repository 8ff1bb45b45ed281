"""Boxes that are drawn: clear of the motion, near to it, and the same however they are drawn."""

import gymnasium as gym
import numpy as np
import pytest

import ikgym
from ikgym.exceptions import InvalidInputError
from ikgym.obstacles.random_boxes import RandomBoxes
from tests.comparison import identical

SCENARIO = ikgym.scenarios.get("panda-clutter-random")
(BOXES,) = SCENARIO.obstacles


def reference(seed, steps=SCENARIO.steps + 1):
    return SCENARIO.episode(seed).joint_path(np.linspace(0.0, SCENARIO.steps * SCENARIO.dt, steps))


def test_the_motion_keeps_its_distance_from_each_box_and_comes_near_it():
    """Also between the steps."""
    bodies = SCENARIO.arm.bodies
    arm = SCENARIO.arm.replace(bodies=bodies.replace(ignored=[(a, b) for a in bodies.names for b in bodies.names]))
    for seed in (0, 1, 2):
        path = reference(seed, 10 * SCENARIO.steps + 1)
        for box in SCENARIO.obstacles_of(seed):
            distances, _ = arm.clearance(path, [box])
            assert BOXES.margin <= distances.min() <= BOXES.within


def test_single_and_vector_environments_draw_the_same_boxes():
    options = {"scenario": SCENARIO, "preview": 1}
    native = gym.make_vec("RedundantIK-v0", num_envs=3, **options)
    first = native.reset(seed=5)[0]["obstacles"]
    for row in range(3):
        single = gym.make("RedundantIK-v0", **options).reset(seed=5 + row)[0]["obstacles"]
        assert identical(first[row], single)
        assert identical(single, np.array([box.numbers() for box in SCENARIO.obstacles_of(5 + row)]))
    assert native.observation_space.contains(native.reset(seed=7)[0])


def test_other_draws_stay_as_they_are():
    """The boxes have a separate stream."""
    without = SCENARIO.replace(obstacles=())
    assert identical(SCENARIO.nominal(3), without.nominal(3))
    assert not identical(SCENARIO.obstacles_of(3)[0].position, SCENARIO.obstacles_of(4)[0].position)


def test_an_episode_with_its_boxes_fixed_is_the_same(tmp_path):
    import baselines

    short = SCENARIO.replace(steps=200)
    fixed = short.replace(trajectory=short.episode(2), obstacles=short.obstacles_of(2))
    assert identical(baselines.track(short, "dls", seed=2).q, baselines.track(fixed, "dls").q)
    SCENARIO.save(tmp_path / "boxes.toml")
    again = ikgym.scenarios.load(tmp_path / "boxes.toml")
    assert identical(again.obstacles_of(2)[9].position, SCENARIO.obstacles_of(2)[9].position)


def test_no_room_and_no_motion():
    crowded = RandomBoxes("box", [-0.1] * 3, [0.1] * 3, [0.5] * 3, [0.5] * 3)
    with pytest.raises(InvalidInputError, match="expected room for 10 boxes"):
        SCENARIO.replace(obstacles=[crowded]).obstacles_of(0)
    with pytest.raises(InvalidInputError, match="expected the trajectory of a random joint motion"):
        SCENARIO.replace(trajectory=SCENARIO.episode(0))
