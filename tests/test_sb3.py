"""The environment of Stable-Baselines3 is its `DummyVecEnv` of N single ones, bit for bit."""

from __future__ import annotations

import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecCheckNan, VecFrameStack, VecMonitor, VecNormalize

import baselines
import ikgym
from ikgym.exceptions import InvalidInputError, ResetNeededError, UnknownNameError
from ikgym.sb3 import RedundantIKVecEnv
from tests.comparison import identical

N = 3
PREVIEW = (1, 3, 8)


def noisy(name="varga7-random", steps=7):
    return ikgym.scenarios.get(name).replace(steps=steps, plant=ikgym.Plant(bias=0.1, noise=0.3))


def single(scenario):
    return Monitor(gym.make("RedundantIK-v0", scenario=scenario, preview=PREVIEW))


def pair(scenario, num_envs=N):
    dummy = DummyVecEnv([lambda: single(scenario)] * num_envs)
    return RedundantIKVecEnv(num_envs, scenario, PREVIEW), dummy


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
    [noisy(), noisy("varga7-fast"), ikgym.scenarios.get("khan8-q1").replace(steps=65), noisy("zhang3-helix")],
    ids=lambda scenario: scenario.name,
)
def test_bit_identical_to_dummy_vec_env_over_whole_episodes(scenario):
    ours, dummy = pair(scenario)
    assert ours.observation_space == dummy.observation_space
    assert ours.action_space == dummy.action_space
    assert ours.seed(11) == dummy.seed(11) == [11, 12, 13]
    assert identical(ours.reset(), dummy.reset())
    ends = 0
    steps = 3 * scenario.steps + 2
    for got, wanted in zip(played(ours, steps), played(dummy, steps), strict=True):
        assert identical(got, wanted)
        ends += len(got[3])
        assert all(info["TimeLimit.truncated"] is True for info in got[3])
    assert ends == 3 * N
    # In the middle of an episode, once seeded anew and once going on.
    for seed in (5, None):
        if seed is not None:
            ours.seed(seed)
            dummy.seed(seed)
        assert identical(ours.reset(), dummy.reset())
        for got, wanted in zip(played(ours, scenario.steps), played(dummy, scenario.steps), strict=True):
            assert identical(got, wanted)


def test_returned_types_are_those_of_dummy_vec_env():
    ours, dummy = pair(noisy(steps=1))
    for env in (ours, dummy):
        env.seed(0)
        env.reset()
    (_, rewards, ended, infos), (*_, wanted) = (env.step(np.zeros((N, 7), np.float32)) for env in (ours, dummy))
    assert rewards.dtype == np.float32
    assert ended.dtype == np.bool_
    for key, value in infos[0].items():
        assert type(value) is type(wanted[0][key])
    for key, value in infos[0]["episode"].items():
        assert type(value) is type(wanted[0]["episode"][key])


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


def test_seeds_and_options_serve_one_reset():
    env = RedundantIKVecEnv(N, noisy())
    env.seed(4)
    env.set_options({"q": np.full(7, 0.25)})
    first = env.reset()
    np.testing.assert_array_equal(first["q"], 0.25)
    second = env.reset()
    assert not (second["q"] == 0.25).any()
    assert not identical(second["nominal"], first["nominal"])
    env.seed(4)
    assert identical(env.reset()["nominal"], first["nominal"])
    assert env.get_attr("np_random_seed") == [4, 5, 6]


def test_options_one_a_row():
    ours, dummy = pair(noisy())
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (N, 7))
    for env in (ours, dummy):
        env.seed(2)
        env.set_options([{"q": start} for start in starts])
    assert identical(ours.reset(), dummy.reset())
    np.testing.assert_array_equal(ours.reset_infos, dummy.reset_infos)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"p": 1}, UnknownNameError, "There is no option of reset 'p'"),
        ({"reset_mask": np.ones(N, dtype=bool)}, UnknownNameError, "'reset_mask'"),
        ({"q": np.zeros(6)}, InvalidInputError, r"options\['q'\]: expected shape \(7,\)"),
        ([{"q": np.zeros(7)}, {}, {}], InvalidInputError, "for all rows or for none, got 1 of 3"),
        ([{}, {}], InvalidInputError, "options: expected 3, one a row, got 2"),
    ],
)
def test_bad_options_change_nothing(options, error, message):
    ours, untouched = RedundantIKVecEnv(N, noisy()), RedundantIKVecEnv(N, noisy())
    for env in (ours, untouched):
        env.seed(1)
        env.reset()
        for _ in range(3):
            env.step(np.zeros((N, 7), np.float32))
    ours.seed(7)
    ours.set_options(options)
    with pytest.raises(error, match=message):
        ours.reset()
    for got, wanted in zip(played(ours, 8), played(untouched, 8), strict=True):
        assert identical(got, wanted)
    ours.set_options()
    untouched.seed(7)
    assert identical(ours.reset(), untouched.reset())


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
    ours.set_attr("level", 1)
    ours.set_attr("level", 2, indices=0)
    assert ours.get_attr("level") == [2, 1, 1]
    ours.set_attr("scaled", lambda x, by: x * by, indices=[0, 2])
    assert ours.env_method("scaled", 3, by=2, indices=[0, 2]) == [6, 6]
    with pytest.raises(AttributeError, match="scaled"):
        ours.env_method("scaled", 3, by=2)
    with pytest.raises(AttributeError, match="scenario"):
        ours.set_attr("scenario", noisy())


def test_wrapped_and_closed():
    ours, dummy = pair(noisy())
    for wrapper in (Monitor, gym.wrappers.TimeLimit):
        assert ours.env_is_wrapped(wrapper) == dummy.env_is_wrapped(wrapper)
        assert ours.env_is_wrapped(wrapper, indices=1) == dummy.env_is_wrapped(wrapper, indices=1)
    with pytest.warns(UserWarning, match="no `render_mode` was passed"):
        assert ours.render() is None
    ours.close()
    ours.close()


def normalized(env):
    return VecNormalize(env, gamma=0.9)


def stacked(env):
    return VecFrameStack(env, 2)


def monitored(env):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The environment is already wrapped with a `Monitor`")
        return VecMonitor(env, info_keywords=("position_error",))


def checked(env):
    return VecCheckNan(env, raise_exception=True)


@pytest.mark.parametrize("wrap", [normalized, stacked, monitored, checked])
def test_wrappers_see_no_difference(wrap):
    scenario = noisy()
    ours, dummy = (wrap(env) for env in pair(scenario))
    for env in (ours, dummy):
        env.seed(8)
    assert identical(ours.reset(), dummy.reset())
    assert ours.get_attr("scenario") == [scenario] * N
    for got, wanted in zip(played(ours, 16), played(dummy, 16), strict=True):
        assert identical(got, wanted)


def test_evaluate_policy():
    """Without a warning, and with the environment's own rewards behind a wrapper that changes them."""
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


LEARNERS = {
    "PPO": (PPO, {"n_steps": 8, "batch_size": 24, "n_epochs": 2}),
    "SAC": (SAC, {"learning_starts": 12, "batch_size": 16}),
}


@pytest.mark.usefixtures("one_thread")
@pytest.mark.parametrize(("algorithm", "parameters"), LEARNERS.values(), ids=LEARNERS)
def test_agents_learn_the_very_same(algorithm, parameters, tmp_path):
    def agent(env):
        policy = {"net_arch": [8]}
        return algorithm("MultiInputPolicy", env, policy_kwargs=policy, seed=0, device="cpu", **parameters)

    steps = 144
    envs = pair(noisy())
    before = agent(envs[0]).policy.state_dict()
    ours, dummy = (agent(env).learn(steps) for env in envs)
    after, wanted = (learned.policy.state_dict() for learned in (ours, dummy))
    assert all(after[key].equal(value) for key, value in wanted.items())
    assert not all(after[key].equal(value) for key, value in before.items())
    assert [info["r"] for info in ours.ep_info_buffer] == [info["r"] for info in dummy.ep_info_buffer]
    assert len(ours.ep_info_buffer) == N * (steps // N // 7)

    ours.save(tmp_path / "agent")
    env = RedundantIKVecEnv(N, noisy(), PREVIEW)
    loaded = algorithm.load(tmp_path / "agent", env=env, device="cpu")
    observation = env.reset()
    got, wanted = (learned.predict(observation, deterministic=True)[0] for learned in (loaded, ours))
    assert identical(got, wanted)
    loaded.learn(N * 8)


def test_without_stable_baselines3_it_says_what_is_missing():
    code = (
        "import sys; sys.modules['stable_baselines3'] = None\n"
        "from ikgym.exceptions import MissingDependencyError\n"
        "try:\n    import ikgym.sb3\n"
        "except MissingDependencyError as error:\n    assert 'pip install \"ikgym[train]\"' in str(error)\n"
        "else:\n    raise SystemExit('imported')"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("use", [lambda envs: PPO("MultiInputPolicy", envs), lambda envs: DummyVecEnv([lambda: envs])])
def test_the_vector_environment_of_gymnasium_is_another_one(use):
    """What Stable-Baselines3 says when it refuses one names what it takes."""
    envs = gym.make_vec("RedundantIK-v0", num_envs=2, scenario=noisy())
    with pytest.raises(ValueError, match="not a Gymnasium environment") as said:
        use(envs)
    assert "for Stable-Baselines3 there is ikgym.sb3.RedundantIKVecEnv" in str(said.value)
    with pytest.raises(InvalidInputError, match=r"RedundantIKVecEnv\(N, scenario, preview\) has the same arms"):
        RedundantIKVecEnv(envs)
