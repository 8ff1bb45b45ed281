"""Drives with a delay and a lag: known, guessed and identified, and what is refused."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from gymnasium.utils import seeding

import baselines
import ikgym
from baselines.solvers.adaptive.drives import Hypotheses, identify_rows, start_memory
from ikgym.exceptions import InvalidInputError
from ikgym.simulator import Simulator

STEPS, SEED = 400, 1_000_003


def gentle(steps=STEPS):
    """A smooth motion of the Panda from rest to rest, at 1 kHz."""
    scenario = ikgym.scenarios.get("panda-random")
    trajectory = dataclasses.replace(scenario.trajectory, duration=steps * 1e-3, scale=(0.1, 0.4))
    return scenario.replace(dt=1e-3, steps=steps, trajectory=trajectory)


def driven(scenario, policy, seeds, delays, bandwidths, *, noise=0.0, q_delay=0):
    """Plays episodes on drives with a delay and a lag: costs and joint paths by step, and the last state.

    The simulator gets the velocities behind the lag, and is told of no acceleration limit.
    """
    rows, dt, unit, arm = len(seeds), scenario.dt, scenario.velocity_limit, scenario.arm
    simulator = Simulator(
        scenario.replace(arm=arm.replace(acceleration_limit=np.full(7, np.inf))), rows, policy.preview
    )
    simulator.reset(np.ones(rows, dtype=bool), [seeding.np_random(seed)[0] for seed in seeds])
    out, state, rng = simulator.observe(), None, np.random.default_rng(0)
    delays, share = np.array(delays), 1.0 - np.exp(-2.0 * np.pi * np.array(bandwidths)[:, None] * dt)
    commands, velocity, setpoint = np.zeros((20, rows, 7)), np.zeros((rows, 7)), np.zeros((rows, 7))
    costs, paths = np.empty((scenario.steps, rows)), [out.q.copy()]
    for k in range(scenario.steps):
        age = min(q_delay, k)
        observation = {
            "q": paths[k - age] + noise * rng.standard_normal((rows, 7)),
            "qdot": setpoint.copy(),
            "pose": out.pose.copy(),
            "nominal": out.nominal.copy(),
            "remaining": out.remaining.copy(),
        }
        if q_delay:
            observation |= {"q_age": np.full((rows, 1), float(age)), "pose_age": np.zeros((rows, 1))}
        action, state = policy.predict(observation, state)
        commands = np.roll(commands, 1, axis=0)
        commands[0] = np.clip(action * unit, -arm.velocity_limit, arm.velocity_limit)
        most = arm.acceleration_limit * dt
        setpoint = setpoint + np.clip(commands[delays, np.arange(rows)] - setpoint, -most, most)
        velocity = velocity + share * (setpoint - velocity)
        out = simulator.step(velocity / unit)
        costs[k] = out.tracking_cost + [scenario.cost.velocity(row) for row in setpoint]
        paths.append(out.q.copy())
    return costs.sum(axis=0), np.array(paths), state


def made(policy="dls", scenario=None, **parameters):
    return baselines.make("predicted", scenario or gentle(), policy=policy, **parameters)


@pytest.fixture(scope="module")
def ideal():
    """What `dls` costs without delay and lag."""
    return driven(gentle(), baselines.make("dls", gentle()), [SEED], [0], [math.inf])[0]


def test_a_policy_of_gain_1_is_lost_by_itself_and_not_with_known_drives(ideal):
    scenario = gentle()
    alone, _, _ = driven(scenario, baselines.make("dls", scenario), [SEED], [5], [13.0])
    known, _, _ = driven(scenario, made(delay=5, bandwidth=13.0, identify=False), [SEED], [5], [13.0])
    assert alone > 1e4 * ideal
    assert known < 1.3 * ideal


def test_unknown_drives_are_identified(ideal):
    """Row by row, each with drives of its own."""
    delays, bandwidths = [2, 7, 12, 0], [10.0, 14.0, 20.0, math.inf]
    policy = made()
    costs, _, state = driven(gentle(), policy, [SEED] * 4, delays, bandwidths)
    told = policy.diagnostics(state)
    np.testing.assert_array_equal(told["delay"], delays)
    np.testing.assert_allclose(told["time_constant"], 1.0 / (2.0 * np.pi * np.array(bandwidths)), rtol=0.03, atol=1e-5)
    assert (costs < 2.0 * ideal).all()


def test_rows_of_a_batch_are_single_calls():
    """With other delays in use beside them, other parts of the reference are shown."""
    delays, bandwidths, scenario = [3, 11], [18.0, 10.0], gentle(60)
    _, together, _ = driven(scenario, made(scenario=scenario), [SEED, SEED + 1], delays, bandwidths)
    for row in range(2):
        alone = driven(
            scenario, made(scenario=scenario), [SEED + row], delays[row : row + 1], bandwidths[row : row + 1]
        )
        np.testing.assert_array_equal(together[:, row], alone[1][:, 0])


def test_without_delay_and_lag_it_is_the_base_policy():
    scenario = gentle(200)
    policy = made(scenario=scenario, delay=0, bandwidth=None, identify=False)
    _, alone, _ = driven(scenario, baselines.make("dls", scenario), [SEED], [0], [math.inf])
    _, path, _ = driven(scenario, policy, [SEED], [0], [math.inf])
    assert policy.preview == 1
    np.testing.assert_allclose(path, alone, atol=1e-7)


@pytest.mark.parametrize(("delay", "bandwidth"), [(5, 20.0), (9, 11.0)])
def test_a_wrong_guess_is_stable(ideal, delay, bandwidth):
    costs, path, _ = driven(gentle(), made(delay=delay, bandwidth=bandwidth, identify=False), [SEED], [7], [15.0])
    assert ideal < costs < 1e4 * ideal
    assert np.abs(np.diff(path[-20:], axis=0)).max() < 1e-4  # it has come to rest with the reference


def test_noise_costs_little_and_the_delay_is_found(ideal):
    policy = made()
    costs, _, state = driven(gentle(), policy, [SEED], [4], [12.0], noise=1e-5)
    assert policy.diagnostics(state)["delay"] == 4
    assert costs < 10.0 * ideal


def test_old_measurements_are_taken_for_what_they_are(ideal):
    """The delay is that of the commands, not that of the sensor."""
    policy = made(oldest=5)
    costs, _, state = driven(gentle(), policy, [SEED], [4], [12.0], q_delay=5)
    assert policy.diagnostics(state)["delay"] == 4
    assert costs < 1.5 * ideal


def test_an_arm_at_rest_says_nothing_of_its_drives():
    guess = Hypotheses(np.arange(8), np.array([1.0, 4.0, 8.0]), 5, 6.0)
    memory, rng = start_memory(1, (2, 3), guess, 10), np.random.default_rng(0)
    for _ in range(500):
        identify_rows(1e-3 * rng.standard_normal((1, 2)), np.zeros(1, dtype=np.int64), tuple(guess), tuple(memory))
    assert memory.delay[0] == 5
    assert memory.lag[0] == pytest.approx(6.0)


def test_preview_is_that_of_the_base_policy_and_the_longest_delay():
    assert made().preview == 1 + 12
    assert made(longest_delay=20).preview == 1 + 20
    assert made("rhc", options={"horizon": 5}, delay=3, identify=False).preview == 4 + 3


@pytest.mark.parametrize(
    "parameters",
    [
        {"delay": -1},
        {"delay": 13},
        {"delay": 1.5},
        {"bandwidth": 0.0},
        {"bandwidth": 5.0},
        {"bandwidth": math.nan},
        {"longest_delay": -1},
        {"lowest_bandwidth": 0.0},
        {"gain": 0.0},
        {"gain": 1.5},
        {"oldest": -1},
        {"identify": "yes"},
        {"policy": "follow_nominal"},
    ],
)
def test_bad_parameters_are_refused(parameters):
    with pytest.raises(InvalidInputError, match=next(iter(parameters))):
        made(**{"policy": "dls", **parameters})
