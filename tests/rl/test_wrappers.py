"""Wrappers for learning: one by one, all of them, and N arms at once, bit for bit."""

import inspect
import itertools
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import ikgym
from ikgym import rl
from ikgym.exceptions import InvalidInputError
from ikgym.rl.track import middle

N = 3


def short(name="varga7-random", steps=20):
    return ikgym.scenarios.get(name).replace(steps=steps)


def played(envs, actions):
    """All that a vector environment returns, ended rows reset by a mask where nobody else does it."""
    yield envs.reset(seed=5)[0]
    for action in actions:
        observation, rewards, terminated, truncated, infos = envs.step(action)
        ended = terminated | truncated
        rows = np.flatnonzero(infos.get("_final_obs", ())).tolist()
        yield observation, rewards, terminated, truncated, [infos["final_obs"][row] for row in rows]
        if envs.metadata["autoreset_mode"] is AutoresetMode.DISABLED and ended.any():
            yield envs.reset(options={"reset_mask": ended})[0]


def same_bits(left, right):
    if isinstance(left, (tuple, list)):
        return len(left) == len(right) and all(map(same_bits, left, right))
    left, right = np.asarray(left), np.asarray(right)
    return (left.dtype, left.shape, left.tobytes()) == (right.dtype, right.shape, right.tobytes())


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize(
    ("name", "distance", "share"), [("varga7-random", 0.05, 0.02), ("panda-camera-slow", 0.0003, 0.6)]
)
def test_native_is_sync_of_singles_bit_for_bit(name, distance, share, mode):
    scenario, changes = short(name), {"lost_distance": distance, "share": share, "history": 2, "commands": 2}
    native = rl.make_vec(scenario, N, autoreset_mode=mode, **changes)
    sync = SyncVectorEnv([lambda: rl.make(scenario, **changes)] * N, autoreset_mode=mode)
    assert native.autoreset_mode is sync.autoreset_mode is mode  # TorchRL asks the wrapper itself
    assert native.single_observation_space == sync.single_observation_space
    assert native.single_action_space == sync.single_action_space
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (50, N, 7)).astype(np.float32)
    lost = over = 0
    for ours, theirs in itertools.zip_longest(played(native, actions), played(sync, actions)):
        assert same_bits(ours, theirs)
        if isinstance(ours, tuple):
            assert native.single_observation_space.contains(ours[0][0])
            lost, over = lost + ours[2].sum(), over + ours[3].sum()
    assert lost > 0
    assert over > 0


@pytest.mark.parametrize("wrapper", [rl.TrackObservation, rl.ShareAction, rl.DistanceReward])
def test_each_wrapper_stands_on_its_own(wrapper):
    env = wrapper(gym.make("RedundantIK-v0", scenario=short(), lost_distance=0.05))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # tables in an observation
        check_env(env, skip_render_check=True)


def test_history_stands_newest_first():
    env = rl.make(short(), history=3)
    first = env.reset(seed=0)[0].reshape(3, -1)
    assert (first == first[0]).all()
    second = env.step(np.ones(7, dtype=np.float32))[0].reshape(3, -1)
    assert not np.array_equal(second[0], first[0])
    assert (second[1:] == first[0]).all()
    with pytest.raises(InvalidInputError, match="observation is a vector"):
        rl.History(gym.make("RedundantIK-v0", scenario=short()))


@pytest.mark.parametrize(("dt", "steps"), [(0.01, (1, 5)), (0.001, (10, 50)), (0.02, (1, 2)), (1.0, (1,))])
def test_the_reference_is_shown_at_times_ahead(dt, steps):
    env = rl.make(ikgym.scenarios.get("panda-random").replace(dt=dt, steps=20))
    assert env.unwrapped.preview == steps
    assert env.observation_space.shape == (2 * (7 + 6 * len(steps)),)


@pytest.mark.parametrize("task", ikgym.tasks.names())
@pytest.mark.parametrize("name", ["varga7-random", "tiago-turn"])
def test_what_an_arm_sees_of_a_task(name, task):
    """Before a step in which the arm stands still: the errors of that step, seen from joint 1."""
    scenario = ikgym.scenarios.get(name).replace(task=ikgym.tasks.get(task))
    env = rl.make(scenario, ahead=(scenario.dt,), zero=50.0, coarse=50.0, fine=5.0, radian=0.5, lost_distance=None)
    arm = scenario.model
    start = np.where(arm.prismatic, 0.2, 0.3) if arm.home is None else np.array(arm.home) + 0.1
    features, _ = env.reset(seed=3, options={"q": start})
    _, reward, *_, info = env.step(np.zeros(arm.joints, dtype=np.float32))
    units = 50.0 * features[2 * arm.joints :].reshape(2, -1)[0]
    coarse = np.roll(units, 3) if task == "skew" else units  # it begins with the orientation
    assert np.linalg.norm(coarse[:3]) == pytest.approx(info["position_error"], rel=1e-5)
    if task not in ("position", "skew"):
        assert np.linalg.norm(coarse[3:]) == pytest.approx(0.5 * info["orientation_error"], rel=1e-5)
    missing = scenario.nominal(3)[1][-3:] - arm.forward(start)[1]
    if task != "skew" and not arm.prismatic[0]:
        missing = ikgym.kernels.rotations.rodrigues(arm.chain.axes[0], -start[0]) @ missing
    np.testing.assert_allclose(coarse[:3], missing, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(features[2 * arm.joints :].reshape(2, -1)[1], np.tanh(units / 5.0), atol=1e-5)
    square = info["position_error"] ** 2 + (0.5 * info.get("orientation_error", 0.0)) ** 2
    assert reward == pytest.approx(1.0 - np.log1p(1e6 * square) / np.log1p(1e6 * 50.0**2), rel=1e-12)


def test_joints_are_seen_from_home_or_the_middle_of_their_range():
    panda, fetch, unlimited = map(ikgym.arms.get, ("panda", "fetch", "varga7"))
    home, units = middle(panda)
    assert np.array_equal(home, panda.home)
    assert units.tolist() == [1.0] * 7
    assert np.array_equal(middle(panda.replace(home=None))[0], 0.5 * (panda.upper + panda.lower))
    assert middle(fetch)[1].tolist() == [0.5 * (fetch.upper - fetch.lower)[0], *[1.0] * 7]
    home, units = middle(unlimited)
    assert not home.any()
    assert units.tolist() == [1.0] * 7
    one_sided = unlimited.replace(lower=[0.5, *[-np.inf] * 6])
    assert middle(one_sided)[0].tolist() == [0.5, *[0.0] * 6]


@pytest.mark.parametrize("kind", ["TrackObservation", "ShareAction", "DistanceReward", "History"])
def test_wrappers_of_one_arm_and_of_many_have_the_same_defaults(kind):
    one, many = (inspect.signature(part).parameters for part in (getattr(rl, kind), getattr(rl.vector, kind).stage))
    assert {name: value.default for name, value in one.items()} == {name: value.default for name, value in many.items()}
