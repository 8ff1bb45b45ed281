"""The loop on drives with delay and lag: calm and on its path, whether they are known or identified."""

from __future__ import annotations

import re

import numpy as np
import pytest

import ikgym
from baselines import Controller, Drives, Guards
from baselines.controller import StopReason
from baselines.controller.drives import half_period
from docs.loop import DrivenArm, peaks, play
from ikgym.exceptions import InvalidInputError
from tests.baselines.controller.circles import circle

LAG = 0.02


def check(controller, scenario, drives, first=1.0):
    """Errors after the first second, and commands of each joint, as the issue of this loop wants them."""
    errors, commands = play(controller, scenario, drives)
    assert controller.stopped is None
    assert errors[round(first / scenario.dt) :].max() < 1e-4
    # The inverse of a lag that is guessed may take one period at the acceleration limit, whatever the joint needs.
    step = 1.01 * scenario.dt * Guards().acceleration(scenario.model)
    assert (np.abs(commands).max(axis=0) < np.maximum(1.3 * peaks(scenario), step)).all()


@pytest.mark.parametrize(("name", "dt", "delay"), [("panda", 1e-3, 2), ("pr2", 4e-3, 3), ("ur10", 4e-3, 0)])
def test_unknown_drives(name, dt, delay):
    """Found in the first second, and reported."""
    scenario = circle(name, dt, seconds=1.3)
    controller = Controller(scenario)
    assert controller.drives is None
    check(controller, scenario, Drives(delay, LAG))
    np.testing.assert_allclose(controller.drives.delay, delay, atol=0.25)
    np.testing.assert_allclose(controller.drives.time_constant, LAG, rtol=0.02)
    assert not any(controller.drives.at_least)


def jerks(commands, scenario):
    """The largest share of the limits of acceleration and of jerk, from rest on."""
    rest = np.zeros((1, commands.shape[1]))
    changes = np.diff(commands, axis=0, prepend=rest)
    steps = np.diff(changes, axis=0, prepend=rest)
    return (np.abs(changes) / scenario.dt / scenario.arm.acceleration_limit).max(), (
        np.abs(steps) / scenario.dt**2 / scenario.arm.jerk_limit
    ).max()


@pytest.mark.parametrize("drives", [Drives(2, LAG), Drives(3, 0.04), Drives(0, 0.005), Drives()])
def test_commands_keep_the_limits_of_jerk(drives):
    """On drives that are identified, with a reference that starts at full acceleration; without them they do not."""
    scenario = circle("panda", seconds=1.5).replace(jerk_limit=None)
    controller = Controller(scenario)
    errors, commands = play(controller, scenario, drives)
    assert controller.stopped is None
    assert max(jerks(commands, scenario)) <= 1.0 + 1e-6
    assert errors[1300:].max() < 5e-5
    if drives.time_constant:
        free = scenario.replace(jerk_limit=np.inf)
        assert jerks(play(Controller(free), free, drives)[1], free)[1] > 1.0


def test_a_stop_keeps_the_limits_of_jerk():
    scenario = circle("panda").replace(jerk_limit=None)
    controller = Controller(scenario, "dls", drives=Drives())
    nominal, q, commands = scenario.nominal(0, controller.ahead), scenario.first_q(scenario.trajectory), []
    for k in range(600):
        commands.append(
            controller.step(q * (np.nan if k >= 300 else 1.0), None, nominal[k + 1 : k + 1 + controller.ahead])
        )
        q = q + scenario.dt * commands[-1]
    assert controller.stopped is not None
    assert np.abs(commands[299]).max() > 0.1
    assert (commands[-1] == 0.0).all()
    assert max(jerks(np.array(commands), scenario)) <= 1.0 + 1e-6


@pytest.mark.parametrize("drives", [Drives(), Drives(2, LAG)])
@pytest.mark.parametrize("reported", ["qdot", "commanded"])
def test_an_arm_in_motion_is_taken_over_with_limits_of_jerk(drives, reported):
    """From an acceleration of 0; and an arm that has stopped itself makes no command run away."""
    scenario = circle("panda").replace(jerk_limit=None)
    controller = Controller(scenario, drives=drives, guards=Guards(position_error=1.0, orientation_error=3.0))
    nominal, q = scenario.nominal(0, controller.ahead), scenario.first_q(scenario.trajectory)
    speed = np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    commands = [speed, speed]
    for k in range(60):
        report = {reported: commands[-1]} if k == 0 or reported == "commanded" else {}
        commands.append(controller.step(q, None, nominal[: controller.ahead], **report))
        q = q + scenario.dt * commands[-1]
    assert controller.stopped is None
    changes = np.diff(commands, axis=0) / scenario.dt
    assert (np.abs(changes) <= (1.0 + 1e-6) * scenario.arm.acceleration_limit).all()
    assert (np.abs(np.diff(changes, axis=0)) <= (1.0 + 1e-6) * scenario.dt * scenario.arm.jerk_limit).all()
    assert np.abs(commands).max() < 0.31
    for fast in (1e300, 0.0):
        for _ in range(40):
            report = controller.step(q, None, nominal[: controller.ahead], commanded=np.full(7, fast))
            assert (np.abs(report) <= scenario.arm.velocity_limit + 0.02).all()


def test_a_report_that_is_refused_changes_nothing():
    scenario = circle("panda").replace(jerk_limit=None)
    loops = [Controller(scenario, drives=Drives()) for _ in range(2)]
    nominal, q = scenario.nominal(0, loops[0].ahead), scenario.first_q(scenario.trajectory)
    for loop in loops:
        loop.step(q, None, nominal[: loop.ahead])
    with pytest.raises(InvalidInputError, match="reference"):
        loops[0].step(q, None, nominal[:1, :3], commanded=np.full(7, 0.1))
    with pytest.raises(InvalidInputError, match=r"commanded: expected shape \(7,\)"):
        loops[0].step(q, None, nominal[: loops[0].ahead], commanded=[0.1])
    with pytest.raises(InvalidInputError, match="commanded_acceleration: expected commanded velocities as well"):
        loops[0].step(q, None, nominal[: loops[0].ahead], commanded_acceleration=np.zeros(7))
    with pytest.raises(InvalidInputError, match=r"commanded_acceleration: expected shape \(7,\)"):
        loops[0].step(q, None, nominal[: loops[0].ahead], commanded=np.zeros(7), commanded_acceleration=[0.1])
    first, second = (loop.step(q, None, nominal[: loop.ahead]) for loop in loops)
    np.testing.assert_array_equal(first, second)
    stop = loops[0].step(q, None, nominal[: loops[0].ahead], commanded=np.full(7, np.nan))
    assert loops[0].stopped is StopReason.NOT_FINITE
    assert np.isfinite(stop).all()
    report = {"commanded": np.zeros(7), "commanded_acceleration": np.full(7, np.inf)}
    assert np.isfinite(loops[1].step(q, None, nominal[: loops[1].ahead], **report)).all()
    assert loops[1].stopped is StopReason.NOT_FINITE


@pytest.mark.slow
@pytest.mark.parametrize("delay", range(4))
@pytest.mark.parametrize("dt", [1e-3, 4e-3])
@pytest.mark.parametrize("name", ["panda", "ur10", "baxter", "pr2"])
def test_unknown_drives_of_all_arms(name, dt, delay):
    for drives in (Drives(delay, LAG), Drives(delay)):
        scenario = circle(name, dt)
        check(Controller(scenario), scenario, drives)


@pytest.mark.parametrize("drives", [Drives(3, LAG), Drives(2), Drives(0, LAG)])
def test_known_drives(drives):
    scenario = circle("panda", 4e-3, seconds=1.0)
    controller = Controller(scenario, drives=drives)
    assert controller.drives == drives
    check(controller, scenario, drives, first=0.5)


def test_wrong_drives_are_followed_late_and_calmly():
    """Twelve periods that nobody knows of: the gain is stable, and errors stay below those of the lag itself."""
    scenario = circle("panda", 4e-3, seconds=2.0)
    errors, commands = play(Controller(scenario, drives=Drives(0, LAG)), scenario, Drives(12, LAG))
    assert 1e-5 < errors[250:].max() < 0.1 * (12 * scenario.dt + LAG)
    # The inverse of a lag that is guessed may take one period at the acceleration limit, whatever the joint needs.
    step = 1.01 * scenario.dt * Guards().acceleration(scenario.model)
    assert (np.abs(commands).max(axis=0) < np.maximum(1.3 * peaks(scenario), step)).all()


def test_the_longest_drives_that_are_found():
    """Twelve periods in which nothing moves are no broken sensor."""
    scenario = circle("pr2", 4e-3, seconds=2.0)
    controller, drives = Controller(scenario), Drives(12, 0.04)
    errors, _ = play(controller, scenario, drives)
    assert controller.stopped is None
    assert errors[250:].max() < 1e-4
    np.testing.assert_allclose(controller.drives.delay, 12, atol=0.1)
    np.testing.assert_allclose(controller.drives.time_constant, 0.04, rtol=0.01)


SPREAD = Drives(3, tuple(np.linspace(0.005, 0.04, 7)))


@pytest.mark.parametrize("dt", [pytest.param(1e-3, marks=pytest.mark.slow), 4e-3, 8e-3])
@pytest.mark.parametrize("known", [True, False])
def test_drives_that_differ_by_joint(dt, known):
    """Lags of 5 to 40 ms: each joint has its model; those known are no worse than those identified."""
    scenario = circle("panda", dt, seconds=2.4)
    controller = Controller(scenario, drives=SPREAD if known else "identify")
    errors, _ = play(controller, scenario, SPREAD)
    assert controller.stopped is None
    assert errors[round(2.0 / dt) :].max() < 5e-6
    if not known:
        np.testing.assert_allclose(controller.drives.delay, 3.0, atol=0.3)
        np.testing.assert_allclose(controller.drives.time_constant, SPREAD.time_constant, rtol=0.04)


def test_drives_beyond_the_range_are_reported_as_at_least():
    scenario = circle("panda", 4e-3, seconds=2.0)
    controller = Controller(scenario, guards=Guards(position_error=None, orientation_error=None))
    play(controller, scenario, Drives((3, 3, 3, 15, 3, 3, 3), (0.02, 0.02, 0.02, 0.02, 0.02, 0.06, 0.02)))
    assert controller.drives.at_least == (False, False, False, True, False, True, False)
    assert re.search("^joint 4: at least 1[23].* periods of delay", str(controller.drives), re.MULTILINE)


@pytest.mark.parametrize("change", [2, -2])
@pytest.mark.parametrize("dt", [1e-3, 4e-3])
def test_a_delay_that_changes_in_motion(dt, change):
    """Two periods more or less when the drives have been known for long: the gain stays stable."""
    scenario = circle("panda", dt, seconds=2.5)
    controller = Controller(scenario)
    arm, reference = DrivenArm(Drives(3, LAG), scenario.start, dt), scenario.nominal(0, controller.ahead)
    commands, errors = [np.zeros(7)] * 2, []
    for k in range(scenario.steps):
        commands.append(controller.step(arm.q, None, reference[k + 1 : k + 1 + controller.ahead]))
        late = (k * dt > 1.0) == (change > 0)
        arm.move(commands[-3 if late else -1])
        errors.append(np.linalg.norm(scenario.arm.forward(arm.q)[1] - reference[k + 1, -3:]))
    assert controller.stopped is None
    assert max(errors[round(1.0 / dt) :]) < 5e-4
    assert max(errors[round(2.0 / dt) :]) < 5e-5
    assert (np.abs(commands).max(axis=0) < 2.5 * peaks(scenario)).all()


def test_nothing_is_said_of_drives_that_have_not_moved():
    scenario = circle("panda", 4e-3)
    controller, still = Controller(scenario), np.repeat(scenario.nominal()[:1], Controller(scenario).ahead, axis=0)
    for _ in range(200):
        controller.step(scenario.start, None, still)
    assert controller.stopped is None
    assert controller.drives is None
    play(controller, scenario.replace(steps=100), Drives())
    np.testing.assert_allclose(controller.drives.delay, 0.0, atol=0.01)
    assert np.max(controller.drives.time_constant or 0.0) < 0.1 * scenario.dt
    controller.reset()
    assert controller.drives is None


def test_other_policies_are_predicted_for_too():
    scenario = circle("panda", 4e-3, seconds=1.3)
    check(Controller(scenario, ("dls", {"damping": 1e-4})), scenario, Drives(2, LAG))
    made = Controller(scenario, "calibrated:policy=predicted,options={'policy':'qp'}")
    assert made.policy.name == "calibrated"


def test_measurements_of_a_known_age():
    """Encoders that are read 8 periods late, on drives with delay."""
    scenario = circle("panda", 4e-3, seconds=1.6)
    plant = ikgym.Plant(command_delay=2, bandwidth=1.0 / (2.0 * np.pi * LAG), q_delay=8, pose_delay=8)
    on = scenario.replace(plant=plant)
    controller = Controller(scenario)
    env = ikgym.RedundantIKEnv(on, preview=controller.ahead)
    seen, _ = env.reset(seed=0)
    for k in range(on.steps):
        ages = {"q_age": seen["q_age"][0], "pose_age": seen["pose_age"][0]}
        qdot = controller.step(seen["q"], seen["pose"], seen["nominal"], **ages)
        seen, *_, info = env.step((qdot / on.velocity_limit).astype(np.float32))
        assert k < 250 or info["position_error"] < 1e-4
    later = half_period(LAG / scenario.dt)  # the environment's drives jump at the beginning of a period
    np.testing.assert_allclose(controller.drives.delay, 2 - later, atol=0.1)
