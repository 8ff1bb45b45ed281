"""Episodes as they are shown are those of the environment."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import baselines
from baselines.viewer.replay import Stage, named, play
from ikgym.exceptions import InvalidInputError, UnknownNameError


@pytest.mark.parametrize("scenario", ["varga7-random", "panda-circle", "faitli3-regular"])
def test_a_replay_is_the_episode(scenario):
    stage = Stage.of(scenario, seed=3, steps=12)
    replay = play(stage, "dls")
    policy = baselines.make("dls", stage.scenario)
    env = gym.make("RedundantIK-v0", scenario=stage.scenario, preview=policy.preview)
    observation, _ = env.reset(seed=3)
    np.testing.assert_array_equal(replay.q[0], observation["q"])
    state, cost = None, 0.0
    for k in range(1, 13):
        action, state = policy.predict(observation, state)
        observation, reward, _, _, info = env.step(action)
        cost -= reward
        np.testing.assert_array_equal(replay.q[k], observation["q"])
        assert replay.position_error[k] == info["position_error"]
        assert replay.cost[k] == pytest.approx(cost, rel=1e-12)
        if stage.scenario.task.has_orientation:
            assert replay.orientation_error[k] == info["orientation_error"]
    assert len(replay.times) == len(stage.path) == len(stage.rotations) == 13
    assert np.isnan(replay.orientation_error).all() == (not stage.scenario.task.has_orientation)


@pytest.mark.parametrize("scenario", ["varga7-random", "panda-circle", "faitli3-regular"])
def test_the_reference_is_that_of_the_scenario(scenario):
    stage = Stage.of(scenario, seed=3, steps=5)
    found = stage.scenario.task.coordinates(stage.rotations, stage.path)
    np.testing.assert_allclose(found, stage.scenario.nominal(3), atol=1e-12)
    _, tool = stage.scenario.arm.forward(stage.start)
    assert stage.errors[0] == pytest.approx(np.linalg.norm(tool - stage.path[0]), abs=1e-12)


def test_pace_is_the_mean_speed():
    whole = Stage.of("panda-circle")
    length = np.linalg.norm(np.diff(whole.path, axis=0), axis=1).sum()
    shift, turn = whole.pace
    assert shift == pytest.approx(length / whole.scenario.steps)
    assert Stage.of("panda-circle", steps=20).pace == whole.pace  # although it begins slowly
    assert 0.0 < turn < 0.1


def test_policies_are_shown_once():
    assert named(["dls", "qp", "dls"]) == ("dls", "qp")
    with pytest.raises(InvalidInputError, match="policy: expected at least one"):
        named([])


def test_mistakes():
    with pytest.raises(UnknownNameError, match="Did you mean 'panda-circle'"):
        Stage.of("panda-cirkle")
    with pytest.raises(InvalidInputError, match="steps"):
        Stage.of("panda-circle", steps=0)
    with pytest.raises(InvalidInputError, match="seed"):
        Stage.of("panda-circle", seed=-1)
    with pytest.raises(UnknownNameError, match="Did you mean 'dls'"):
        play(Stage.of("panda-circle", steps=2), "dlss")
