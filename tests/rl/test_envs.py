"""Environments for learning: what they show and reward, and one arm against N, bit for bit."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordVideo as RecordVideos

import baselines
import ikgym
import ikgym.sb3
from ikgym import rl
from ikgym.exceptions import ResetNeededError
from ikgym.rendering.renderer import HEIGHT, WIDTH
from ikgym.rl.track import joint_scales
from tests.comparison import identical, played_alike, random_actions

N = 3
CONTEXT = ikgym.scenarios.get("learning-context").replace(steps=7)


def short(name="varga7-random", steps=20):
    return ikgym.scenarios.get(name).replace(steps=steps)


def context(seed):
    return CONTEXT.drawn_plant(seed).context.astype(np.float32)


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize(
    "task",
    [
        rl.Task(short(), lost_distance=0.12, share=0.02, history=2, commands=2),
        rl.Task(short("panda-camera-slow"), lost_distance=0.0003, history=2, commands=2),
        rl.Task(CONTEXT, lost_distance=None, context=True, counted=3, progress=2.0),
        rl.Task(short("learning-track"), lost_distance=0.03, inverse=True, history=2),
    ],
    ids=lambda task: task.scenario.name,
)
def test_native_is_sync_of_singles_bit_for_bit(task, mode):
    native = rl.LearningVectorEnv(N, task, autoreset_mode=mode)
    sync = SyncVectorEnv([lambda: rl.LearningEnv(task)] * N, autoreset_mode=mode)
    returned = played_alike(native, sync, random_actions(native, 50, largest=1.0))
    lost, over = (sum(step[which].sum() for step in returned) for which in (2, 3))
    assert bool(lost) is (task.lost_distance is not None)
    assert over > 0


def test_history_stands_newest_first():
    env = rl.make(short(), history=3)
    first = env.reset(seed=0)[0].reshape(3, -1)
    assert (first == first[0]).all()
    second = env.step(np.ones(7, dtype=np.float32))[0].reshape(3, -1)
    assert not np.array_equal(second[0], first[0])
    assert (second[1:] == first[0]).all()


@pytest.mark.parametrize(("dt", "steps"), [(0.01, (1, 5)), (0.001, (10, 50)), (0.02, (1, 2)), (1.0, (1,))])
def test_the_reference_is_shown_at_times_ahead(dt, steps):
    env = rl.make(ikgym.scenarios.get("panda-random").replace(dt=dt, steps=20))
    assert env.unwrapped.preview == steps
    assert env.observation_space.shape == (2 * (7 + 6 * len(steps)),)


@pytest.mark.parametrize("task", ikgym.tasks.names())
@pytest.mark.parametrize("name", ["varga7-random", "tiago-turn"])
def test_what_an_arm_sees_of_a_task(name, task):
    """Before a step in which the arm is at rest: the errors of that step, seen from joint 1."""
    scenario = ikgym.scenarios.get(name).replace(task=ikgym.tasks.get(task))
    env = rl.make(scenario, ahead=(scenario.dt,), half=50.0, coarse=50.0, fine=5.0, radian=0.5, lost_distance=None)
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
    cost = info["tracking_cost"] + info["velocity_cost"]
    assert reward == pytest.approx(1.0 / (1.0 + cost / 50e3**2), rel=1e-12)


@pytest.mark.parametrize("name", ["varga7-random", "tiago-turn", "learning-track"])
def test_the_inverse_is_that_of_damped_least_squares(name):
    """It is the velocity of `dls` in the first step, when no reference before is known."""
    scenario = ikgym.scenarios.get(name)
    env, bare = rl.make(scenario, ahead=(scenario.dt, 3.0 * scenario.dt), inverse=True), rl.make(scenario)
    (seen, _), (less, _) = env.reset(seed=1), bare.reset(seed=1)
    n, fastest = scenario.joints, scenario.largest_qdot
    for i, steps in ((0, 1), (1, 3)):
        plain = gym.make("RedundantIK-v0", scenario=scenario, preview=(steps,))
        action, _ = baselines.make("dls", scenario).predict(plain.reset(seed=1)[0])
        expected = np.clip(action * scenario.velocity_limit / (steps * fastest), -5.0, 5.0)
        shown = seen[len(less) + i * n : len(less) + (i + 1) * n]
        np.testing.assert_allclose(shown, expected, rtol=1e-4, atol=1e-6)


def test_joints_are_seen_from_home_or_the_middle_of_their_range():
    panda, fetch, unlimited = map(ikgym.arms.get, ("panda", "fetch", "varga7"))
    home, units = joint_scales(panda)
    assert np.array_equal(home, panda.home)
    assert units.tolist() == [1.0] * 7
    assert np.array_equal(joint_scales(panda.replace(home=None))[0], 0.5 * (panda.upper + panda.lower))
    assert joint_scales(fetch)[1].tolist() == [0.5 * (fetch.upper - fetch.lower)[0], *[1.0] * 7]
    home, units = joint_scales(unlimited)
    assert not home.any()
    assert units.tolist() == [1.0] * 7
    one_sided = unlimited.replace(lower=[0.5, *[-np.inf] * 6])
    assert joint_scales(one_sided)[0].tolist() == [0.5, *[0.0] * 6]


def test_the_context_ends_the_observation_and_is_that_of_the_plant():
    shown, hidden = (rl.make(CONTEXT, context=one) for one in (True, False))
    for seed in (3, 4):
        (seen, info), (other, same) = shown.reset(seed=seed), hidden.reset(seed=seed)
        np.testing.assert_array_equal(seen, [*other, *context(seed)])
        np.testing.assert_array_equal(info["context"].astype(np.float32), context(seed))
        assert identical(info, same)
    np.testing.assert_array_equal(shown.step(np.zeros(7))[0][-7:], context(4))
    assert rl.make("panda-payload").reset(seed=3)[1] == {}


def test_last_observations_have_the_context_of_their_own_episodes():
    envs = rl.make_vec(CONTEXT, N, context=True, lost_distance=None, autoreset_mode="SameStep")
    envs.reset(seed=4)
    for _ in range(CONTEXT.steps):
        seen, *_, infos = envs.step(np.zeros((N, 7)))
    np.testing.assert_array_equal([one[-7:] for one in infos["final_obs"]], [context(4 + row) for row in range(N)])
    assert (seen[:, -7:] != [context(4 + row) for row in range(N)]).any(axis=1).all()


BRIEF = short("panda-random", steps=3)


def drawn(n, **options):
    return rl.make_vec(BRIEF, n, render_mode="rgb_array", **options)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_pictures_of_many_are_those_of_single_ones(mode):
    ours = drawn(2, autoreset_mode=mode)
    theirs = SyncVectorEnv([lambda: rl.make(BRIEF, render_mode="rgb_array")] * 2, autoreset_mode=mode)
    with pytest.raises(ResetNeededError, match="call reset"):
        ours.render()
    for envs in (ours, theirs):
        envs.reset(seed=3)
    for _ in range(BRIEF.steps + 2):
        for envs in (ours, theirs):
            *_, truncated, _ = envs.step(np.full((2, 7), 0.5, dtype=np.float32))
            if mode is AutoresetMode.DISABLED and truncated.any():
                envs.reset(options={"reset_mask": truncated})
    for mine, other in zip(ours.render(), theirs.render(), strict=True):  # in their second episodes
        np.testing.assert_array_equal(mine, other)


def test_episodes_of_many_arms_are_recorded_side_by_side(tmp_path):
    pytest.importorskip("moviepy")
    envs = RecordVideos(drawn(4), str(tmp_path / "videos"), episode_trigger=lambda _: True)
    envs.reset(seed=0)
    envs.step(np.zeros((4, 7), dtype=np.float32))
    assert np.array(envs.recorded_frames).shape == (2, 4 * HEIGHT * WIDTH // (2 * WIDTH), 2 * WIDTH, 3)
    envs.close()
    assert len(list(tmp_path.glob("videos/*.mp4"))) == 1


def test_arms_of_stable_baselines3_are_drawn():
    envs = ikgym.sb3.make_vec(BRIEF, 2, render_mode="rgb_array")
    envs.reset()
    assert envs.render_mode == "rgb_array"
    assert [picture.shape for picture in envs.get_images()] == 2 * [(HEIGHT, WIDTH, 3)]
