"""The environment of Stable-Baselines3 is its `DummyVecEnv` of N single ones, bit for bit."""

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

import baselines
import ikgym
from ikgym.exceptions import IkgymError, InvalidInputError, ResetNeededError
from ikgym.sb3 import RedundantIKVecEnv, make_vec
from tests.comparison import identical

N = 3
PREVIEW = (1, 3, 8)


def noisy(name="varga7-random", steps=7):
    return ikgym.scenarios.get(name).replace(steps=steps, plant=ikgym.Plant(bias=0.1, noise=0.3))


def single(scenario):
    return Monitor(gym.make("RedundantIK-v0", scenario=scenario, preview=PREVIEW))


def pair(scenario):
    """Ours and Stable-Baselines3's: of a scenario, or for learning of an id."""
    if scenario in ikgym.rl.IDS:
        return make_vec(scenario, N), make_vec_env(scenario, N)
    return RedundantIKVecEnv(N, scenario, PREVIEW), DummyVecEnv([lambda: single(scenario)] * N)


def without_time(infos, ended):
    """Infos of ended episodes; how long they took is no two clocks' agreement."""
    out = []
    for info in (info for info, end in zip(infos, ended, strict=True) if end):
        episode = {key: value for key, value in info["episode"].items() if key != "t"}
        assert info["episode"]["t"] > 0.0
        out.append({**info, "episode": episode})
    return out


def played(env, steps, seed=0):
    """All that an environment returns to the same random actions, some of them beyond the box."""
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        actions = rng.uniform(-1.2, 1.2, (env.num_envs, *env.action_space.shape)).astype(np.float32)
        observation, rewards, ended, infos = env.step(actions)
        yield observation, rewards, ended, without_time(infos, ended)


@pytest.mark.parametrize(
    "scenario",
    [
        *(noisy(), noisy("varga7-fast"), ikgym.scenarios.get("khan8-q1").replace(steps=65), noisy("zhang3-helix")),
        *ikgym.rl.IDS,
    ],
    ids=lambda scenario: getattr(scenario, "name", scenario),
)
def test_bit_identical_to_dummy_vec_env_over_whole_episodes(scenario):
    ours, dummy = pair(scenario)
    assert ours.observation_space == dummy.observation_space
    assert ours.action_space == dummy.action_space
    assert ours.seed(11) == dummy.seed(11) == [11, 12, 13]
    assert identical(ours.reset(), dummy.reset())
    ends = 0
    steps = 3 * ours.scenario.steps + 2
    for got, wanted in zip(played(ours, steps), played(dummy, steps), strict=True):
        assert identical(got, wanted)
        ends += len(got[3])
    assert ends >= 3 * N
    # In the middle of an episode, once seeded anew and once going on.
    for seed in (5, None):
        if seed is not None:
            ours.seed(seed)
            dummy.seed(seed)
        assert identical(ours.reset(), dummy.reset())
        for got, wanted in zip(played(ours, 65), played(dummy, 65), strict=True):
            assert identical(got, wanted)


def test_what_is_returned_is_the_callers():
    scenario = noisy(steps=2)
    ours, untouched = RedundantIKVecEnv(N, scenario), RedundantIKVecEnv(N, scenario)
    actions = np.full((N, 7), 0.3, np.float32)
    for env in (ours, untouched):
        env.seed(1)
        first = env.reset()
    last = first
    for _ in range(5):
        ours.step_async(actions)
        actions *= -1.0
        observation, rewards, ended, infos = ours.step_wait()
        wanted = untouched.step(-actions)
        assert identical((observation, rewards, ended), wanted[:3])
        assert identical(without_time(infos, ended), without_time(wanted[3], wanted[2]))
        assert not any(np.shares_memory(observation[key], last[key]) for key in last)
        for info in infos:
            final = info.get("terminal_observation", {})
            assert not any(np.shares_memory(value, observation[key]) for key, value in final.items())
            for value in final.values():
                value[:] = np.nan
        for value in (*observation.values(), rewards):
            value[:] = 0.0
        ended[:] = True
        last = observation


@pytest.mark.parametrize(
    "options",
    [{"p": 1}, {"reset_mask": np.ones(N, dtype=bool)}, {"q": np.zeros(6)}, [{"q": np.zeros(7)}, {}, {}], [{}, {}]],
)
def test_bad_options_change_nothing(options):
    ours, untouched = RedundantIKVecEnv(N, noisy()), RedundantIKVecEnv(N, noisy())
    for env in (ours, untouched):
        env.seed(1)
        env.reset()
        env.step(np.zeros((N, 7), np.float32))
    ours.seed(7)
    ours.set_options(options)
    with pytest.raises(IkgymError):
        ours.reset()
    for got, wanted in zip(played(ours, 8), played(untouched, 8), strict=True):
        assert identical(got, wanted)


def test_bad_steps_change_nothing():
    ours, untouched = RedundantIKVecEnv(N, noisy()), RedundantIKVecEnv(N, noisy())
    with pytest.raises(ResetNeededError, match="call reset"):
        ours.step(np.zeros((N, 7)))
    for env in (ours, untouched):
        env.seed(1)
        env.reset()
    for bad in (np.zeros(7), np.full((N, 7), np.nan), [[1.0], [1.0, 2.0]]):
        with pytest.raises(InvalidInputError, match="action"):
            ours.step(bad)
    with pytest.raises(InvalidInputError, match="got None"):
        ours.step_wait()
    ours.step_async(np.ones((N, 7)))
    ours.seed(1)
    ours.reset()
    with pytest.raises(InvalidInputError, match="got None"):
        ours.step_wait()
    for got, wanted in zip(played(ours, 8), played(untouched, 8), strict=True):
        assert identical(got, wanted)


def test_attributes_of_rows():
    ours, dummy = pair(noisy())
    for env in (ours, dummy):
        env.seed(3)
        env.reset()
    for name in ("scenario", "observation_space", "action_space", "render_mode", "np_random_seed"):
        assert ours.get_attr(name) == dummy.get_attr(name)
    assert ours.get_attr("np_random_seed", 1) == [4]
    assert ours.get_attr("np_random_seed", [2, 0]) == [5, 3]
    assert [g.random() for g in ours.get_attr("np_random")] == [g.random() for g in dummy.get_attr("np_random")]
    assert ours.scenario is ours.get_attr("scenario")[0]
    assert ours.render_mode is None
    assert not ours.has_attr("level")
    for refused in (lambda: ours.set_attr("scenario", noisy()), lambda: ours.env_method("step", np.zeros(7))):
        with pytest.raises(AttributeError, match=r"'scenario' of one arm|no method 'step'"):
            refused()


def test_evaluate_policy():
    """Without a warning, and with the environment's rewards behind a wrapper that changes them."""
    scenario = noisy(steps=5)
    policy = baselines.make("dls", scenario)
    ours = RedundantIKVecEnv(2, scenario, policy.preview)
    dummy = DummyVecEnv(
        [lambda: Monitor(gym.make("RedundantIK-v0", scenario=scenario, preview=policy.preview))] * ours.num_envs
    )
    results = []
    for env in (ours, dummy, VecNormalize(ours, norm_obs=False)):
        env.seed(6)
        results.append(evaluate_policy(policy, env, n_eval_episodes=6, return_episode_rewards=True))
    assert results[0] == results[1] == results[2]
    assert results[0][1] == [5] * 6


@pytest.mark.usefixtures("one_thread")
def test_agents_learn_the_very_same():
    def agent(env):
        settings = {"n_steps": 8, "batch_size": 24, "n_epochs": 2, "policy_kwargs": {"net_arch": [8]}}
        return PPO("MultiInputPolicy", env, seed=0, device="cpu", **settings)

    steps = 144
    envs = pair(noisy())
    before = agent(envs[0]).policy.state_dict()
    ours, dummy = (agent(env).learn(steps) for env in envs)
    after, wanted = (learned.policy.state_dict() for learned in (ours, dummy))
    assert all(after[key].equal(value) for key, value in wanted.items())
    assert not all(after[key].equal(value) for key, value in before.items())
    assert [info["r"] for info in ours.ep_info_buffer] == [info["r"] for info in dummy.ep_info_buffer]
    assert len(ours.ep_info_buffer) == N * (steps // N // 7)


def test_the_vector_environment_of_gymnasium_is_another_one():
    """What Stable-Baselines3 says when it refuses one names what it takes."""
    envs = gym.make_vec("RedundantIK-v0", num_envs=2, scenario=noisy())
    with pytest.raises(ValueError, match=r"ikgym\.sb3\.RedundantIKVecEnv"):
        DummyVecEnv([lambda: envs])


def test_scenarios_are_given_once():
    by_keyword = make_vec(scenario="learning-track", num_envs=2)
    assert (by_keyword.scenario.name, by_keyword.num_envs) == ("learning-track", 2)
    assert make_vec("ikgym:ikgym/Fast-v0").scenario.name == "learning-fast"
    with pytest.raises(InvalidInputError, match="scenario: expected one, got 'learning-track' and 'panda-random'"):
        make_vec("learning-track", scenario="panda-random")
