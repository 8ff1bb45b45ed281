"""Iterative learning: what is learnt from episode to episode, what is forgotten, and what is refused."""

from __future__ import annotations

import dataclasses

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from ikgym.exceptions import InvalidInputError

STEPS, SEED = 200, 1_000_003


def wrong_arm(steps=STEPS):
    """A smooth motion of a Panda whose links are 0.3 mm off, which solvers do not know."""
    scenario = ikgym.scenarios.get("panda-random")
    trajectory = dataclasses.replace(scenario.trajectory, duration=steps * 1e-3, scale=(0.1, 0.2))
    offsets = scenario.arm.offsets + 3e-4 * np.random.default_rng(3).standard_normal((7, 3))
    model = scenario.arm.replace(acceleration_limit=np.full(7, np.inf))
    return scenario.replace(
        arm=model.replace(offsets=offsets), model=model, dt=1e-3, steps=steps, trajectory=trajectory
    )


def costs(policy, seeds, scenario=None, starts=True, state=None):
    """The costs of episodes in a row, behind their first half, and the last state."""
    env = gym.make("RedundantIK-v0", scenario=scenario or wrong_arm(), preview=policy.preview)
    out = []
    for seed in seeds:
        observation, _ = env.reset(seed=seed)
        done, total, k = False, 0.0, 0
        while not done:
            action, state = policy.predict(observation, state, np.array([starts and k == 0]))
            observation, reward, _, done, _ = env.step(action)
            total, k = total - reward * (k >= STEPS // 2), k + 1
        out.append(total)
    return out, state


def made(policy="rhc", **parameters):
    options = {"options": {"horizon": 4}} if policy == "rhc" else {}
    return baselines.make("iterative_learning", wrong_arm(), policy=policy, **options, **parameters)


def test_learns_the_calibration_along_a_path_of_a_policy_that_reads_q_alone():
    """The errors of 3e-4 m make the first episode; the next ones are rid of nine tenths of the cost each."""
    found, _ = costs(made(keep=True), [SEED] * 4)
    assert found[1] < 0.2 * found[0]
    assert found[3] < 0.02 * found[0]


def test_learns_nothing_without_keep():
    found, _ = costs(made(), [SEED] * 2)
    assert found[0] == found[1]


def test_the_first_episode_is_that_of_the_inner_policy():
    alone, _ = costs(baselines.make("rhc", wrong_arm(), horizon=4), [SEED])
    assert costs(made(keep=True), [SEED])[0] == alone


def test_another_path_begins_with_nothing_learnt():
    (_, other), _ = costs(made(keep=True), [SEED, SEED + 1])
    (fresh,), _ = costs(made(keep=True), [SEED + 1])
    assert other == fresh


def test_no_state_is_nothing_learnt():
    policy = made(keep=True)
    (first,), state = costs(policy, [SEED])
    assert costs(policy, [SEED])[0][0] == first
    assert costs(policy, [SEED], state=state)[0][0] < 0.2 * first


def test_the_rest_of_a_path_that_is_too_long_is_that_of_the_inner_policy():
    found, _ = costs(made(keep=True, longest=STEPS // 4), [SEED] * 2)
    assert found[1] == pytest.approx(found[0], rel=1e-3)


def test_the_lead_of_a_delay_is_learnt_with():
    """Commands come 12 steps late, and a low gain is behind: 30 steps ahead learning at the full rate stays stable."""
    scenario = wrong_arm().replace(plant=ikgym.Plant(command_delay=12, bandwidth=10.0))
    low = {"policy": "dls", "options": {"gain": 0.02}, "keep": True, "rate": 1.0}
    found = {
        lead: costs(baselines.make("iterative_learning", scenario, **low, lead=lead), [SEED] * 5, scenario)[0]
        for lead in (0, 25)
    }
    assert found[25][4] < 0.05 * found[25][0]
    assert found[25][4] < 0.5 * found[0][4]


@pytest.mark.parametrize(
    "parameters",
    [
        {"keep": 1.5},
        {"rate": 0.0},
        {"rate": 2.0},
        {"lead": -1},
        {"knot_spacing": 0},
        {"longest": 0},
        {"oldest": -1},
        {"policy": "follow_nominal"},
    ],
)
def test_bad_parameters_are_refused(parameters):
    with pytest.raises(InvalidInputError, match=next(iter(parameters))):
        made(**{"policy": "dls", **parameters})
