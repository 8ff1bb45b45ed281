"""`get_attr` and `spec`, as Gymnasium's environments have them."""

import gymnasium as gym
import numpy as np
import pytest

import ikgym
from ikgym.exceptions import NoAttributeError
from tests.comparison import identical

N = 3
SHORT = ikgym.scenarios.get("varga7-random").replace(steps=4)


def native(**options):
    return gym.make_vec("RedundantIK-v0", num_envs=N, scenario=SHORT, **options)


def test_attributes_are_those_of_sync_environments():
    ours, theirs = native(), gym.make_vec("RedundantIK-v0", num_envs=N, scenario=SHORT, vectorization_mode="sync")
    for envs in (ours, theirs):
        envs.reset(seed=4)
    for name in ("scenario", "observation_space", "action_space", "metadata", "render_mode", "np_random_seed"):
        assert ours.get_attr(name) == theirs.get_attr(name)
    assert ours.get_attr("np_random_seed") == (4, 5, 6)
    assert [g.random() for g in ours.get_attr("np_random")] == [g.random() for g in theirs.get_attr("np_random")]
    message = r"have no 'step': they are reset, stepped and seen together\. Available: scenario, .*mode='sync'"
    with pytest.raises(NoAttributeError, match=message) as caught:
        ours.get_attr("step")
    assert isinstance(caught.value, AttributeError)


def test_specs_say_how_long_episodes_are():
    single, many = gym.make("RedundantIK-v0", scenario=SHORT), native()
    assert single.spec.max_episode_steps == single.unwrapped.spec.max_episode_steps == 4
    assert many.spec.max_episode_steps == 4
    assert gym.spec("RedundantIK-v0").max_episode_steps is None
    assert ikgym.RedundantIKEnv(SHORT).spec is None
    assert ikgym.RedundantIKVectorEnv(2, SHORT).spec is None


def test_environments_are_made_again_from_their_specs():
    single = gym.make("RedundantIK-v0", scenario=SHORT, preview=3)
    for again in (gym.make(single.spec), gym.make(single.unwrapped.spec)):
        assert identical(again.reset(seed=1), single.reset(seed=1))
        ends = [again.step(np.zeros(7, dtype=np.float32))[3] for _ in range(4)]
        assert ends == [False, False, False, True]
    many = native()
    assert gym.make_vec(many.spec).num_envs == N
    assert gym.make_vec("RedundantIK-v0", num_envs=2, scenario=SHORT, max_episode_steps=4).num_envs == 2
    for steps in (2, 5):
        many = gym.make_vec("RedundantIK-v0", num_envs=2, scenario=SHORT, max_episode_steps=steps)
        assert many.spec.max_episode_steps == min(steps, 4)
