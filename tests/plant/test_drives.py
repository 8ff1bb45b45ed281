"""Drives joint by joint: fractions of a delay, drives of low order, gains and resonances, against plain formulas."""

import copy
import math
import pickle

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import ikgym
from ikgym import Plant
from ikgym.exceptions import InvalidInputError
from ikgym.plant.response import deflection, fastest
from tests.comparison import identical
from tests.plant.effects import panda
from tests.plant.test_effects import Played

LOW_ORDER = (1.2, -0.5, 0.06, 0.05, 0.1, 0.08, 0.02)
STEPS = 80


def still_commands(k):
    """Commands within the limits of acceleration: sums of sines, another one a joint."""
    return 1e-3 * np.sin(0.2 * (1.0 + 0.3 * np.arange(7)) * k) + 5e-4


def played(**effects):
    """The velocities that joints have, and the commands of an ideal plant, in [rad/s]. Shapes (STEPS, 7)."""
    moved, ideal = (Played(Plant(**given), still_commands, STEPS) for given in (effects, {}))
    dt = moved.scenario.dt
    return (np.diff(moved.true_q, axis=0) / dt, np.diff(ideal.true_q, axis=0) / dt, moved)


def test_delays_and_lags_of_each_joint():
    delay, bandwidth = np.array([0, 1, 2.25, 3.5, 0.75, 5, 1.5]), np.array([math.inf, 5, 10, 20, 30, 40, 50])
    velocity, command, run = played(command_delay=tuple(delay), bandwidth=tuple(bandwidth))
    assert run.scenario.plant.longest_command_delay == 5
    for j in range(7):
        whole, part = int(delay[j]), delay[j] % 1.0
        late = np.concatenate([np.zeros(whole + 1), command[:, j]])[: STEPS + 1]
        late = (1.0 - part) * late[1:] + part * late[:-1]
        share = 1.0 - math.exp(-2.0 * math.pi * bandwidth[j] * run.scenario.dt)
        wanted = lfilter([share], [1.0, share - 1.0], late)
        np.testing.assert_allclose(velocity[:, j], wanted, atol=1e-11)


def test_a_drive_of_low_order_and_its_gain():
    velocity, command, _ = played(drive=LOW_ORDER, gain=(1, 0.9, 1, 1, 1, 1.2, 1))
    wanted = lfilter(LOW_ORDER[3:], [1.0, *(-np.array(LOW_ORDER[:3]))], command, axis=0)
    np.testing.assert_allclose(velocity, wanted * [1, 0.9, 1, 1, 1, 1.2, 1], atol=1e-11)
    by_joint, _, _ = played(drive=(LOW_ORDER,) * 7, gain=(1, 0.9, 1, 1, 1, 1.2, 1))
    assert identical(velocity, by_joint)


def test_a_link_swings_behind_its_encoder():
    """The exact answer of a spring and a damper to a velocity that is constant within each step."""
    frequency, damping = (8.0, 12.0, 20.0, math.inf, 40.0, 100.0, 15.0), 0.05
    velocity, command, run = played(resonance=frequency, resonance_damping=damping)
    np.testing.assert_allclose(np.diff(run.of("q"), axis=0) / run.scenario.dt, command, atol=1e-10)  # encoders
    for j, omega in enumerate(2.0 * np.pi * np.array(frequency)):
        if math.isinf(omega):
            np.testing.assert_allclose(velocity[:, j], command[:, j], atol=1e-11)
            continue
        # From the velocity of the encoder's side to the link's coordinate: (2 ζ ω s + ω²) / (s (s² + 2 ζ ω s + ω²)).
        system = ([2 * damping * omega, omega**2], [1.0, 2 * damping * omega, omega**2, 0.0])
        top, bottom, _ = cont2discrete(system, run.scenario.dt)
        wanted = lfilter(top.ravel(), bottom, np.append(command[:, j], 0.0))
        np.testing.assert_allclose(np.array(run.true_q)[:, j] - run.true_q[0][j], wanted, atol=1e-11)


def test_without_them_the_plant_is_bit_for_bit_the_same():
    effects = {"bandwidth": 15.0, "command_delay": 3, "backlash": 1e-4, "noise": 1e-3}
    usual = Played(Plant(**effects))
    other = Played(
        Plant(**effects | {"bandwidth": (15.0,) * 7, "command_delay": (3,) * 7}, gain=1.0, resonance=math.inf)
    )
    assert identical(usual.true_q, other.true_q)
    assert identical(usual.infos, other.infos)


def test_bounds_hold_without_stops():
    """Of velocities that overshoot, and of links that swing: reversals at full speed excite both."""
    free = panda(steps=300)
    none = np.full(7, np.inf)
    arm = free.arm.replace(lower=-none, upper=none, acceleration_limit=none)
    drive = (1.7, -0.8, 0.0, 0.1, 0.0, 0.0, 0.0)
    plant = Plant(drive=drive, gain=1.1, resonance=12.0, resonance_damping=0.02)
    scenario = free.replace(arm=arm, plant=plant, start=free.arm.home)
    env = ikgym.RedundantIKEnv(scenario)
    env.reset(seed=0)
    limit = scenario.velocity_limit
    most, swing = fastest(plant, limit), deflection(plant, limit, scenario.dt)
    impulse = lfilter(drive[3:], [1.0, *(-np.array(drive[:3]))], [1.0] + 999 * [0.0])
    np.testing.assert_allclose(most, 1.1 * limit * np.abs(impulse).sum(), rtol=1e-9)
    before, fast, wide = env._simulator.true_q[0].copy(), 0.0, 0.0
    for k in range(300):
        seen, *_ = env.step(np.full(7, 1.0 if k // 41 % 2 else -1.0))
        assert env.observation_space.contains(seen)
        now = env._simulator.true_q[0].copy()
        wide = max(wide, (np.abs(now - seen["q"]) / swing).max())
        fast, before = max(fast, (np.abs(now - before) / (scenario.dt * most)).max()), now
    assert 0.0 < wide < 1.0
    assert fast > 0.5


def test_an_episode_entered_in_motion_goes_on_at_its_velocity():
    """Histories of drives of low order and of springs are those of a long time at that velocity."""
    plant = Plant(drive=LOW_ORDER, gain=0.9, resonance=20.0, command_delay=2)
    scenario = panda(plant, steps=60)
    env = ikgym.RedundantIKEnv(scenario)
    seen, _ = env.reset(seed=1, options={"step": 20})
    action = seen["qdot"] / scenario.velocity_limit
    before = env._simulator.true_q[0].copy()
    env.step(action)
    steady = 0.9 * sum(LOW_ORDER[3:]) / (1.0 - sum(LOW_ORDER[:3]))
    moved = (env._simulator.true_q[0] - before) / scenario.dt
    assert np.abs(seen["qdot"]).max() > 1e-3
    np.testing.assert_allclose(moved, steady * seen["qdot"], rtol=1e-5, atol=1e-9)


def test_what_is_said_of_them():
    plant = Plant(command_delay=(1, 2.5, 3), bandwidth=(10.0, math.inf, 20.0), drive=LOW_ORDER, gain=0.9)
    assert not plant.ideal
    assert not plant.random
    assert plant.context == ()
    assert pickle.loads(pickle.dumps(plant)) == copy.deepcopy(plant) == plant
    assert Plant(command_delay=2.0).command_delay == 2
    half = plant.replace(drive=(), resonance=10.0).scaled(0.5)
    assert half.command_delay == (0.5, 1.25, 1.5)
    assert (half.bandwidth, half.gain, half.resonance) == ((20.0, math.inf, 40.0), 0.95, 20.0)
    assert plant.replace(drive=(), resonance=10.0).scaled(0.0).ideal
    assert Plant(command_delay=2.5).scaled(1.0).command_delay == 2.5
    with pytest.raises(InvalidInputError, match="of low order"):
        plant.scaled(0.5)


def test_files_and_drawn_plants_keep_them(tmp_path):
    numbers = tuple(1.0 + 0.5 * j for j in range(7))
    plant = Plant(
        command_delay=numbers,
        bandwidth=(math.inf, *numbers[1:]),
        drive=(LOW_ORDER,) * 7,
        resonance=numbers,
        gain=numbers,
    )
    scenario = panda(plant)
    scenario.save(tmp_path / "one.toml")
    read = ikgym.scenarios.load(tmp_path / "one.toml")
    assert read.plant == plant
    drawn = read.replace(plant=plant.replace(zero=1e-3)).drawn_plant(3)
    assert (drawn.command_delay, drawn.bandwidth) == (plant.command_delay, plant.bandwidth)
    assert read.drawn_plant().command_delay == plant.command_delay
