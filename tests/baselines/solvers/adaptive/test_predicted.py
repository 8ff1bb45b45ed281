"""Drives with a delay and a lag: known, guessed and identified, and what is refused."""

import dataclasses

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollouts
from baselines.solvers.adaptive.drives import KNOWN, Hypotheses, identify_rows, start_memory

STEPS, SEED = 400, 1_000_003


def gentle(steps=STEPS):
    """A smooth motion of the Panda from rest to rest, at 1 kHz."""
    scenario = ikgym.scenarios.get("panda-random")
    trajectory = dataclasses.replace(scenario.trajectory, duration=steps * 1e-3, scale=(0.1, 0.4))
    return scenario.replace(dt=1e-3, steps=steps, trajectory=trajectory)


def driven(scenario, policy, seeds=(SEED,), **plant):
    """Plays episodes on a plant: costs, joint paths and what the policy takes for true at the end, by row."""
    on = scenario.replace(plant=ikgym.Plant(**plant))
    episodes = rollouts(on, policy, list(seeds))
    costs = np.array([(episode.tracking_cost + episode.velocity_cost).sum() for episode in episodes])
    found = {name: np.array([e.diagnostics[name][-1] for e in episodes]) for name in episodes[0].diagnostics}
    return costs, np.array([episode.q for episode in episodes]), found


def made(policy="dls", scenario=None, **parameters):
    return baselines.make("predicted", scenario or gentle(), policy=policy, **parameters)


@pytest.fixture(scope="module")
def ideal():
    """What `dls` costs without delay and lag."""
    return driven(gentle(), baselines.make("dls", gentle()))[0]


def test_a_policy_of_gain_1_is_lost_by_itself_and_not_with_known_drives(ideal):
    scenario, drives = gentle(), {"command_delay": 5, "bandwidth": 13.0}
    alone, _, _ = driven(scenario, baselines.make("dls", scenario), **drives)
    known, _, _ = driven(scenario, made(delay=5, bandwidth=13.0, identify=False), **drives)
    assert alone > 1e4 * ideal
    assert known < 1.3 * ideal


def test_unknown_drives_are_identified():
    """Row by row, each with other drives; within 3 % of the lag, or 0.1 ms."""
    scenario, seeds = gentle(), range(SEED, SEED + 6)
    drives = {"command_delay": (0, 12), "bandwidth": (10.0, 20.0)}
    costs, together, found = driven(scenario, made(), seeds, **drives)
    drawn = [scenario.replace(plant=ikgym.Plant(**drives)).drawn_plant(seed) for seed in seeds]
    assert len({one.command_delay for one in drawn}) > 3
    delays = np.tile([[one.command_delay] for one in drawn], 7)
    np.testing.assert_allclose(found["delay"], delays, atol=0.15)
    constants = 1.0 / (2.0 * np.pi * np.tile([[one.bandwidth] for one in drawn], 7))
    np.testing.assert_allclose(found["time_constant"], constants, rtol=0.03, atol=1e-4)
    ideal, _, _ = driven(scenario, baselines.make("dls", scenario), seeds)
    assert (costs < 2.0 * ideal).all()
    # With other delays in other rows, a row is shown another part of the reference, and yet is a single call.
    for row in range(2):
        np.testing.assert_array_equal(together[row], driven(scenario, made(), [SEED + row], **drives)[1][0])


def test_without_delay_and_lag_it_is_the_base_policy():
    scenario = gentle(200)
    policy = made(scenario=scenario, delay=0, bandwidth=None, identify=False)
    _, alone, _ = driven(scenario, baselines.make("dls", scenario))
    _, path, _ = driven(scenario, policy)
    assert policy.preview == 1
    np.testing.assert_allclose(path, alone, atol=1e-7)


def test_a_wrong_guess_is_stable(ideal):
    policy = made(delay=9, bandwidth=11.0, identify=False)
    costs, path, _ = driven(gentle(), policy, command_delay=7, bandwidth=15.0)
    assert ideal < costs < 1e4 * ideal
    assert np.abs(np.diff(path[0, -20:], axis=0)).max() < 1e-4  # it has come to rest with the reference


def test_old_joint_coordinates_are_taken_for_what_they_are(ideal):
    """The delay is that of the commands, not that of the sensor."""
    costs, _, found = driven(gentle(), made(oldest=5), command_delay=4, bandwidth=12.0, q_delay=5)
    np.testing.assert_allclose(found["delay"], 4, atol=0.05)
    assert costs < 1.5 * ideal


def test_old_poses_are_held_against_the_joint_coordinates_of_their_time(ideal):
    """The model is right, and so there is no offset, however old the pose is."""
    costs = [
        driven(gentle(), made(oldest=oldest), command_delay=4, bandwidth=12.0, pose_delay=9, pose_every=8)[0]
        for oldest in (0, 16)
    ]
    assert costs[0] > 10.0 * ideal
    assert costs[1] < 1.5 * ideal


@pytest.mark.parametrize(("noise", "rougher", "worse"), [(1e-5, 1.05, 1.15), (1e-4, 1.3, 5.2)])
def test_noise_of_the_encoders_is_not_amplified(noise, rougher, worse):
    """On late drives, once they are identified; accelerations and errors relative to those without noise."""
    scenario = ikgym.scenarios.get("panda-ideal").replace(dt=4e-3, steps=375)
    policy, found = baselines.make("predicted", scenario), []
    for deviation in (0.0, noise):
        on = scenario.replace(plant=ikgym.Plant(command_delay=3, bandwidth=8.0, q_noise=deviation))
        episode = rollouts(on, policy, [SEED])[0]
        acceleration = np.diff(episode.q, 2, axis=0)[125:] / scenario.dt**2
        found.append([np.sqrt(np.mean(x**2)) for x in (acceleration, episode.position_error[125:])])
    ratio = np.divide(found[1], found[0])
    assert ratio[0] < rougher
    assert ratio[1] < worse


def test_an_arm_at_rest_says_nothing_of_its_drives():
    guess = Hypotheses(True, 7, np.array([[1.0, 4.0, 8.0]] * 2), np.full(2, 5.0), np.full(2, 6.0))
    memory, rng = start_memory(1, 3, guess, 0), np.random.default_rng(0)
    for _ in range(500):
        identify_rows(1e-3 * rng.standard_normal((1, 2)), np.zeros(1, dtype=np.int64), tuple(guess), tuple(memory))
    np.testing.assert_array_equal(memory.delay, 5.0)
    np.testing.assert_allclose(memory.lag, 6.0)
    assert (memory.doubt > KNOWN).all()


def test_preview_is_that_of_the_base_policy_and_the_longest_delay():
    assert made().preview == 1 + 12
    assert made(longest_delay=20).preview == 1 + 20
    assert made("rhc", options={"horizon": 5}, delay=3, identify=False).preview == 4 + 3
