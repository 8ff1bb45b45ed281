"""The native vector environment is N single ones, bit for bit."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import ikgym
from ikgym.exceptions import InvalidInputError, ResetNeededError
from tests.comparison import played_alike, random_actions
from tests.every_scenario import every_scenario
from tests.limited import limited
from tests.plant.effects import PLANTS, panda

N = 3
NOISE = ikgym.Plant(bias=0.1, noise=0.3)


def make(scenario, mode, vectorization="vector_entry_point", **options):
    kwargs = {"vector_kwargs": {"autoreset_mode": mode}} if vectorization == "sync" else {"autoreset_mode": mode}
    kwargs |= {"scenario": scenario, "vectorization_mode": vectorization, **options}
    return gym.make_vec("RedundantIK-v0", num_envs=N, **kwargs)


def short(name, steps=7):
    scenario = ikgym.scenarios.get(name)
    return scenario.replace(steps=max(steps, int(np.max(scenario.plant.command_delay))))


EPISODES = [
    *every_scenario(short),
    *(
        pytest.param(one, id=f"{one.name}-{one.steps}-{one.plant.noise}")
        for one in (
            short("varga7-random").replace(plant=NOISE),
            short("khan8-q1", 130),
            short("panda-clutter-random"),  # obstacles that are drawn
            limited(),
            limited(plant=NOISE),
        )
    ),
]
#: Scenarios, options and modes; those of the slow run differ in what an episode is alone.
CASES = [
    *(
        pytest.param(*one.values, {"preview": (1, 3, 8)}, mode, id=f"{one.id}-{mode.value}", marks=one.marks)
        for one in EPISODES
        for mode in AutoresetMode
        if not one.marks or mode is AutoresetMode.NEXT_STEP
    ),
    *(
        pytest.param(panda(plant, steps=7), {"commands": 2}, mode, id=f"{name}-{mode.value}")
        for name, plant in PLANTS.items()
        for mode in AutoresetMode
        if name in ("context", "all") or mode is AutoresetMode.SAME_STEP
    ),
]


@pytest.mark.parametrize(("scenario", "options", "mode"), CASES)
def test_bit_identical_to_sync_over_whole_episodes(scenario, options, mode):
    native, sync = (make(scenario, mode, kind, **options) for kind in ("vector_entry_point", "sync"))
    returned = played_alike(native, sync, random_actions(native, 3 * scenario.steps + 2))
    assert sum(truncated.sum() for *_, truncated, _ in returned) >= 2 * N
    held = sum(infos.get("at_limit", np.zeros((N, 3))).sum(axis=0) for *_, infos in returned)
    assert (held > 0).all() if scenario.name == limited().name else held.any() <= scenario.arm.limited


@pytest.mark.parametrize("mode", list(AutoresetMode), ids=lambda mode: mode.value)
def test_record_episode_statistics(mode):
    steps = 5
    envs = RecordEpisodeStatistics(make(short("varga7-fast", steps), mode))
    envs.reset(seed=0)
    returns = np.zeros(N)
    for _ in range(steps):
        _, rewards, _, truncated, infos = envs.step(np.full((N, 7), 0.1, dtype=np.float32))
        returns += rewards
    assert truncated.all()
    info = infos["episode"]
    np.testing.assert_array_equal(info["l"], steps)
    np.testing.assert_allclose(info["r"], returns, rtol=1e-12)
    if mode is AutoresetMode.DISABLED:
        envs.reset(options={"reset_mask": np.array([True, True, False])})
        np.testing.assert_array_equal(envs.env.unwrapped._simulator.steps_made, [0, 0, steps])


def test_ignored_actions_may_be_anything_but_others_may_not():
    native = make(short("varga7-fast", 2), AutoresetMode.NEXT_STEP)
    native.reset(seed=0)
    bad = np.zeros((N, 7), dtype=np.float32)
    bad[1, 2] = np.nan
    before = native._simulator._state.q.copy()
    with pytest.raises(InvalidInputError, match="action of row 1: expected finite numbers"):
        native.step(bad)
    np.testing.assert_array_equal(native._simulator._state.q, before)
    for _ in range(2):
        native.step(np.zeros((N, 7), dtype=np.float32))
    observation, rewards, _, truncated, infos = native.step(np.full((N, 7), np.nan, dtype=np.float32))
    assert not truncated.any()
    assert not rewards.any()
    assert infos == {}
    np.testing.assert_array_equal(observation["remaining"], 2.0)


def test_step_needs_episodes():
    native = make(short("varga7-fast", 2), AutoresetMode.DISABLED)
    actions = np.zeros((N, 7), dtype=np.float32)
    with pytest.raises(ResetNeededError, match="call reset"):
        native.step(actions)
    with pytest.raises(ResetNeededError, match="leave out the reset_mask"):
        native.reset(options={"reset_mask": np.array([True, False, False])})
    native.reset(seed=0)
    native.step(actions)
    native.step(actions)
    with pytest.raises(ResetNeededError, match=r"rows \[0, 1, 2\] have ended and autoreset is disabled"):
        native.step(actions)
