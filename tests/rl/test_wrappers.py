"""Wrappers for learning: one by one, all of them, and N arms at once, bit for bit."""

import itertools
import math
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import ikgym
from ikgym import rl
from ikgym.exceptions import InvalidInputError
from ikgym.rl.feature_kernels import MOST, radian

N = 3
PREVIEW = (10, 40, 100)


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
@pytest.mark.parametrize(("name", "distance"), [("varga7-random", 0.02), ("panda-camera-slow", 0.0003)])
def test_native_is_sync_of_singles_bit_for_bit(name, distance, mode):
    scenario, changes = short(name), {"lost_distance": distance, "history": 2, "commands": 2}
    native = rl.make_vec(scenario, N, autoreset_mode=mode, **changes)
    sync = SyncVectorEnv([lambda: rl.make(scenario, **changes)] * N, autoreset_mode=mode)
    assert native.autoreset_mode is sync.autoreset_mode is mode  # TorchRL asks the wrapper itself
    assert native.single_observation_space == sync.single_observation_space
    assert native.single_action_space == sync.single_action_space
    actions = np.random.default_rng(0).uniform(-5.0, 5.0, (50, N, 7)).astype(np.float32)
    lost = over = 0
    for ours, theirs in itertools.zip_longest(played(native, actions), played(sync, actions)):
        assert same_bits(ours, theirs)
        if isinstance(ours, tuple):
            assert native.single_observation_space.contains(ours[0][0])
            lost, over = lost + ours[2].sum(), over + ours[3].sum()
    assert lost > 0
    assert over > 0


@pytest.mark.parametrize("wrapper", [rl.AgentObservation, rl.RelativeAction, rl.LogReward])
def test_each_wrapper_stands_on_its_own(wrapper):
    env = wrapper(gym.make("RedundantIK-v0", scenario=short(), preview=PREVIEW, lost_distance=0.05))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # boxes that are not of unit length, tables in an observation
        check_env(env, skip_render_check=True)


def test_history_stands_newest_first():
    env = rl.History(rl.AgentObservation(gym.make("RedundantIK-v0", scenario=short(), preview=PREVIEW)), 3)
    first = env.reset(seed=0)[0].reshape(3, -1)
    assert (first == first[0]).all()
    second = env.step(np.ones(7, dtype=np.float32))[0].reshape(3, -1)
    assert not np.array_equal(second[0], first[0])
    assert (second[1:] == first[0]).all()
    with pytest.raises(InvalidInputError, match="observation is a vector"):
        rl.History(gym.make("RedundantIK-v0", scenario=short()))


def test_gymnasium_accepts_what_is_made():
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*different from the unwrapped version.*")
        warnings.filterwarnings("ignore", message=".*We recommend .* symmetric and normalized.*")
        check_env(rl.make(short()), skip_render_check=True)


def test_actions_are_in_the_unit_of_what_is_asked_for():
    scenario = ikgym.scenarios.get("varga7-random")
    plain = ikgym.RedundantIKEnv(scenario, preview=PREVIEW)
    env = rl.RelativeAction(ikgym.RedundantIKEnv(scenario, preview=PREVIEW), share=0.5, furthest=5.0)
    agent = rl.AgentObservation(plain, furthest=5.0)
    features, _ = agent.reset(seed=1, options={"step": 300})
    env.reset(seed=1, options={"step": 300})
    n, w = 7, 6
    due, share, seen = features[:w], features[w], features[3 * n : 4 * n]
    # The direction is v̂ / (0.2 + |v̂|), beside 0.2 / (0.2 + |v̂|): together they have a length of 1.
    assert math.isclose(np.linalg.norm(due) + share, 1.0, rel_tol=1e-6)
    moved, *_ = env.step(np.ones(n, dtype=np.float32))
    before = env.unwrapped.scenario.nominal_joint_path(1)
    assert np.allclose(moved["qdot"], moved["qdot"][0])  # every joint the same velocity
    velocity = (before[300] - before[299]) / scenario.dt
    unit = moved["qdot"][0] / 0.5
    assert np.allclose(seen, np.clip(velocity / unit, -4.0, 4.0), atol=1e-5)


@pytest.mark.parametrize(("name", "turned"), [
    ("varga7-random", False), ("varga7-pose-random", True), ("tiago-turn", False), ("panda-random", True),
])  # fmt: skip
def test_what_joints_can_do_is_their_column_of_the_jacobian_times_what_is_due(name, turned):
    env = ikgym.RedundantIKEnv(name, preview=PREVIEW)
    env.reset(seed=2)
    seen, *_ = env.step(np.full(env.action_space.shape, 0.5, dtype=np.float32))
    scenario, agent = env.scenario, rl.AgentObservation(env)
    features = agent.observation(seen).astype(np.float64)
    assert agent.observation_space.contains(features.astype(np.float32))
    rotation, _, jacobian = scenario.model.forward_and_jacobian(seen["q"])
    if scenario.task.name == "skew":
        jacobian = scenario.task.jacobian(rotation, jacobian)
    due, n = features[:6].reshape(2, 3), scenario.joints
    if turned:
        due = due @ ikgym.kernels.rotations.rodrigues(scenario.model.chain.axes[0], seen["q"][0]).T
    unit = radian(scenario.model.chain)
    products = np.concatenate([jacobian[:3].T @ due[0] / unit**2, jacobian[3:].T @ due[1]]).clip(-MOST, MOST)
    assert np.allclose(features[7 : 7 + 2 * n], products, atol=1e-6)
    assert np.ptp(products) > 0.1


def test_rewards_are_what_the_logarithm_of_the_cost_leaves():
    kept = {"scenario": short(), "preview": PREVIEW, "lost_distance": 0.05}
    action = np.full(7, 0.02, dtype=np.float32)
    plain, env = gym.make("RedundantIK-v0", **kept), rl.LogReward(gym.make("RedundantIK-v0", **kept), 0.1, 14.0)
    plain.reset(seed=0), env.reset(seed=0)
    lost, rewards = False, []
    while not lost:
        _, cost, lost, *_ = plain.step(action)
        rewards.append(env.step(action)[1])
        assert math.isclose(rewards[-1], 0.1 * max(0.0, 1.0 - math.log1p(-cost) / 14.0), rel_tol=1e-12)
    assert 0.0 <= rewards[-1] < rewards[0] < 0.1
