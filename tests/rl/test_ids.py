"""The environments by id: one table of checks over all of them."""

from __future__ import annotations

import functools
import importlib
import pickle
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import NormalizeObservation, RecordEpisodeStatistics, RecordVideo, TimeLimit
from stable_baselines3.common.env_checker import check_env as check_env_of_sb3
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv

import ikgym
from baselines.episodes import begin
from ikgym.exceptions import IkgymError
from ikgym.rl import IDS
from ikgym.rl.task import steps_ahead
from ikgym.sb3 import make_vec
from tests.comparison import identical, played_alike, random_actions

N = 3
SPAWN = {"start_method": "spawn"}
SIZES = {"Reach": 26, "Track": 38, "Fast": 38, "Limits": 38, "Camera": 272, "Payload": 272}

every_id = pytest.mark.parametrize("name", IDS)
one_id_at_least = pytest.mark.parametrize(
    "name", [name if "Track" in name else pytest.param(name, marks=pytest.mark.slow) for name in IDS]
)


def actions_of(env, steps, seed=0):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, *env.action_space.shape)).astype(np.float32)


def outcomes(env, actions, seed=None):
    """All that an environment returns, up to the end of the episode."""
    out = [env.reset(seed=seed)[0]]
    for action in actions:
        observation, reward, terminated, truncated, _ = env.step(action)
        out += [observation, reward]
        if terminated or truncated:
            return [*out, terminated, truncated]
    return out


@every_id
def test_both_checkers_accept_it_without_a_warning(name):
    env = gym.make(name, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check="Track" not in name)
        check_env_of_sb3(env)


@every_id
def test_spaces_and_specification(name):
    env = gym.make(name)
    size = SIZES[name.removeprefix("ikgym/").removesuffix("-v0")]
    assert env.observation_space.shape == (size,)
    assert env.observation_space.dtype == np.float32
    assert env.action_space == gym.spaces.Box(-1.0, 1.0, (7,), np.float32)
    assert env.spec.max_episode_steps == env.unwrapped.scenario.steps
    assert 100 <= env.spec.max_episode_steps <= 400
    assert 0.0 < env.spec.reward_threshold < env.spec.max_episode_steps
    assert env.metadata["render_fps"] == round(1.0 / env.unwrapped.scenario.dt)
    assert f"`Box(-5.0, 5.0, ({size},), float32)`" in type(env.unwrapped).__doc__


@every_id
def test_made_again_from_its_specification_it_is_wrapped_once(name):
    env = gym.make(name)
    again = gym.make(env.spec)
    actions = actions_of(env, 20)
    assert identical(outcomes(env, actions, 4), outcomes(again, actions, 4))
    assert type(again.unwrapped) is type(env.unwrapped)
    assert str(again) == str(env)


@pytest.mark.parametrize(
    ("name", "mode"),
    [*((name, AutoresetMode.NEXT_STEP) for name in IDS), *(("ikgym/Reach-v0", mode) for mode in [*AutoresetMode][1:])],
)
def test_native_vector_is_sync_of_singles_bit_for_bit(name, mode):
    native = gym.make_vec(name, N, autoreset_mode=mode)
    sync = gym.make_vec(name, N, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode})
    returned = played_alike(native, sync, random_actions(native, native.spec.max_episode_steps + 5, largest=1.0))
    assert sum((terminated | truncated).sum() for _, _, terminated, truncated, _ in returned) >= N


@every_id
def test_costs_below_are_those_of_the_benchmark_bit_for_bit(name):
    env = gym.make(name)
    task, scenario = env.unwrapped.task, env.unwrapped.scenario
    actions = actions_of(env, 30) * 0.2
    env.reset(seed=11)
    infos = [env.step(action)[-1] for action in actions]
    fractions = actions.astype(np.float64) * (task.share * scenario.largest_qdot / scenario.velocity_limit)
    ahead = steps_ahead(task.ahead, scenario.dt)
    arms, _ = begin(scenario, [11], preview=ahead, commands=task.commands)
    for info, action in zip(infos, fractions, strict=True):
        out = arms.step(action[None])
        assert info["tracking_cost"] == out.tracking_cost[0]
        assert info["velocity_cost"] == out.velocity_cost[0]


@every_id
def test_rewards_are_what_the_class_says(name):
    env = gym.make(name, lost_distance=None)
    task, steps = env.unwrapped.task, env.spec.max_episode_steps
    distance = {0.5: "√(√c / {:g})", 1: "√c / {:g}", 2: "c / {:g}²"}[task.steepness].format(1000 * task.half)
    assert f"1 / (1 + {distance})" in type(env.unwrapped).__doc__
    env.reset(seed=0)
    out = [env.step(action) for action in actions_of(env, steps)]
    cost = np.array([info["tracking_cost"] + info["velocity_cost"] for *_, info in out])
    near = 1.0 / (1.0 + (np.sqrt(cost) / (1000.0 * task.half)) ** task.steepness)
    expected = task.progress * np.diff(near, prepend=near[0])
    expected[-(task.counted or 0) :] += near[-(task.counted or 0) :]
    assert [reward for _, reward, *_ in out][1:] == pytest.approx(expected[1:], rel=1e-9, abs=1e-12)


@every_id
def test_an_episode_begins_at_its_first_step_also_after_a_lost_one(name):
    env, most = gym.make(name, lost_distance=0.02), np.ones(7, dtype=np.float32)
    env.reset(seed=0)
    for _ in range(3):
        _, _, lost, _, info = env.step(most)
        assert info["time"] == env.unwrapped.scenario.dt
        while not lost:
            lost = env.step(most)[2]
        env.reset()


@every_id
def test_pickled_in_mid_episode_it_goes_on_as_before(name):
    env = gym.make(name)
    env.reset(seed=2)
    actions = actions_of(env, 6)
    env.step(actions[0])
    again = pickle.loads(pickle.dumps(env))
    for action in actions[1:]:
        assert identical(env.step(action)[:4], again.step(action)[:4])
    assert identical(env.reset()[0], again.reset()[0])


@every_id
def test_wrappers_of_gymnasium(name):
    env = NormalizeObservation(RecordEpisodeStatistics(TimeLimit(gym.make(name, lost_distance=None), 4)))
    env.reset(seed=0)
    steps = [env.step(action) for action in actions_of(env, 4)]
    seen, _, terminated, truncated, info = steps[-1]
    assert truncated
    assert not terminated
    assert info["episode"]["r"] == pytest.approx(sum(step[1] for step in steps))
    assert seen.shape == env.unwrapped.observation_space.shape
    assert np.abs(seen).max() < 10.0


@one_id_at_least
def test_an_episode_is_recorded(name, tmp_path):
    pytest.importorskip("moviepy")
    env = TimeLimit(gym.make(name, render_mode="rgb_array"), 4)
    env = RecordVideo(env, str(tmp_path / "videos"), episode_trigger=lambda _: True, disable_logger=True)
    env.reset(seed=0)
    for action in actions_of(env, 4):
        env.step(action)
    env.close()
    assert len(list(tmp_path.glob("videos/*.mp4"))) == 1


@every_id
def test_torchrl_takes_it(name):
    check_env_specs = pytest.importorskip("torchrl.envs.utils").check_env_specs
    from torchrl.envs import GymEnv, GymWrapper

    check_env_specs(GymEnv(name))
    check_env_specs(GymWrapper(gym.make_vec(name, 2, autoreset_mode="SameStep")))


@one_id_at_least
def test_spawned_workers_return_what_one_process_does(name):
    makers = [functools.partial(gym.make, f"ikgym:{name}")]
    ours, theirs = AsyncVectorEnv(makers, context="spawn"), SyncVectorEnv(makers)
    try:
        assert identical(ours.reset(seed=4)[0], theirs.reset(seed=4)[0])
        for actions in actions_of(theirs, 3):
            assert identical(ours.step(actions)[:4], theirs.step(actions)[:4])
    finally:
        ours.close()


def test_fields_of_the_task_can_be_changed():
    env = gym.make("ikgym/Track-v0", lost_distance=None, history=2)
    assert env.observation_space.shape == (2 * SIZES["Track"],)
    assert gym.make(env.spec).observation_space == env.observation_space
    assert gym.make_vec("ikgym/Track-v0", 2, history=2).single_observation_space == env.observation_space
    for make in (gym.make, gym.make_vec):
        with pytest.raises(IkgymError, match="Did you mean 'history'") as refused:
            make("ikgym/Track-v0", histroy=2)
        assert isinstance(refused.value, TypeError)  # as other libraries expect who try keywords


@pytest.mark.slow
def test_workers_of_stable_baselines3_find_it_by_its_module():
    envs = make_vec_env("ikgym:ikgym/Track-v0", 1, seed=4, vec_env_cls=SubprocVecEnv, vec_env_kwargs=SPAWN)
    try:
        seen = envs.reset()
        assert identical(seen, ikgym.rl.make_vec("learning-track", 1).reset(seed=4)[0])
    finally:
        envs.close()


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_episodes_are_truncated_early_as_by_the_wrapper_of_gymnasium(mode):
    """Counted from the reset on, also where an episode is entered later; and no later than the scenario ends."""
    for steps, entry in ((7, {}), (7, {"step": 5}), (500, {"step": 190})):
        ours = gym.make_vec("ikgym/Track-v0", 2, max_episode_steps=steps, autoreset_mode=mode)
        makers = [functools.partial(gym.make, "ikgym/Track-v0", max_episode_steps=steps)] * 2
        theirs = SyncVectorEnv(makers, autoreset_mode=mode)
        assert ours.spec.max_episode_steps == min(steps, 200)
        assert identical(ours.reset(seed=4, options=entry)[0], theirs.reset(seed=4, options=entry)[0])
        truncated = 0
        for actions in actions_of(theirs, 18):
            ended = ours.step(actions)
            assert identical(ended[:4], theirs.step(actions)[:4])
            truncated += ended[3].sum()
        assert truncated == (4 if steps == 7 else 2)
    with pytest.raises(IkgymError, match="max_episode_steps: expected a whole number of at least 1, got 0"):
        gym.make_vec("ikgym/Track-v0", 2, max_episode_steps=0)


@pytest.mark.parametrize("make", [gym.make, gym.make_vec, make_vec], ids=["make", "make_vec", "sb3"])
def test_another_scenario_has_to_end_where_the_id_does(make):
    late = ikgym.scenarios.get("learning-track").replace(plant=ikgym.Plant(command_delay=1))
    make("ikgym/Track-v0", scenario=late)
    with pytest.raises(IkgymError, match=r"expected 200 steps, .* got 1000 of 'panda-random'; ikgym\.rl\.make"):
        make("ikgym/Track-v0", scenario="panda-random")


@every_id
def test_videos_of_vectors_are_as_fast_as_those_of_one_arm(name):
    speed = gym.make(name).metadata["render_fps"]
    envs = gym.make_vec(name, 2)
    assert envs.metadata["render_fps"] == envs.get_attr("metadata")[0]["render_fps"] == speed
    assert make_vec(name, 2).metadata["render_fps"] == speed


def test_the_bases_of_environments_are_plain_and_lead_to_gymnasium():
    """As automatic wrappers of other libraries, such as that of skrl, look for it."""
    for env in (ikgym.rl.make("learning-track"), gym.make_vec("ikgym/Track-v0", 2).unwrapped):
        bases = [str(base) for base in type(env).__bases__]
        assert any(base.startswith("<class 'gymnasium.") for base in bases)
        assert all(base.endswith("'>") for base in bases)


def test_importing_again_registers_nothing_twice():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        importlib.reload(ikgym)
    assert set(IDS) <= set(gym.registry)
