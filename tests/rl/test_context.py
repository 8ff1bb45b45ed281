"""The context of an episode, shown to learners or hidden from them."""

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import ikgym
from ikgym.rl import Task
from tests.comparison import identical

SCENARIO = ikgym.scenarios.get("learning-context").replace(steps=7)
SHOWN = Task(SCENARIO, context=True, lost_distance=None)
N = 3


def context(seed):
    return SCENARIO.drawn_plant(seed).context.astype(np.float32)


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
def test_single_synchronous_and_native_agree(mode):
    task = SHOWN.replace(history=2)
    native = task.arms(N, autoreset_mode=mode)
    sync = SyncVectorEnv([lambda: task.arm()] * N, autoreset_mode=mode)
    assert native.observation_space == sync.observation_space
    assert identical(native.reset(seed=4), sync.reset(seed=4))
    rng = np.random.default_rng(0)
    for _ in range(17):
        actions = rng.uniform(-1, 1, (N, 7)).astype(np.float32)
        got = native.step(actions)
        assert identical(got, sync.step(actions))
        assert native.observation_space.contains(got[0])


def test_the_context_ends_the_observation_and_is_that_of_the_plant():
    shown, hidden = (Task(SCENARIO, context=one).arm() for one in (True, False))
    for seed in (3, 4):
        (seen, info), (other, same) = shown.reset(seed=seed), hidden.reset(seed=seed)
        np.testing.assert_array_equal(seen, [*other, *context(seed)])
        np.testing.assert_array_equal(info["context"].astype(np.float32), context(seed))
        assert identical(info, same)
    np.testing.assert_array_equal(shown.step(np.zeros(7))[0][-7:], context(4))
    assert ikgym.rl.make("panda-payload").reset(seed=3)[1] == {}


def test_last_observations_have_the_context_of_their_own_episodes():
    envs = SHOWN.arms(N, autoreset_mode="SameStep")
    envs.reset(seed=4)
    for _ in range(SCENARIO.steps):
        seen, *_, infos = envs.step(np.zeros((N, 7)))
    np.testing.assert_array_equal([one[-7:] for one in infos["final_obs"]], [context(4 + row) for row in range(N)])
    assert (seen[:, -7:] != [context(4 + row) for row in range(N)]).any(axis=1).all()


def test_an_arm_seed_keeps_the_context():
    env = ikgym.RedundantIKEnv(SCENARIO)
    kept = [env.reset(seed=seed, options={"arm_seed": 9})[1]["context"] for seed in (1, 2)]
    assert identical(*kept)
    assert identical(kept[0], SCENARIO.drawn_plant(1, arm_seed=9).context)
    assert not identical(kept[0], env.reset(seed=1)[1]["context"])


def test_gymnasium_finds_no_fault():
    check_env(ikgym.RedundantIKEnv(SCENARIO), skip_render_check=True)
