"""The loop on drives with delay and lag: calm and on its path, whether they are known or identified."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines import Controller, Drives
from baselines.controller.guards import Guards
from docs.loop import peaks, played, with_drives
from tests.baselines.controller.circles import circle

LAG = 0.02


def check(controller, scenario, drives, first=1.0):
    """Errors after the first second, and commands of each joint, as the issue of this loop wants them."""
    errors, commands = played(controller, with_drives(scenario, drives))
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
    assert controller.drives.delay == delay
    assert controller.drives.time_constant == pytest.approx(LAG, rel=0.01)


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
    errors, commands = played(Controller(scenario, drives=Drives(0, LAG)), with_drives(scenario, Drives(12, LAG)))
    assert 1e-5 < errors[250:].max() < 0.1 * (12 * scenario.dt + LAG)
    # The inverse of a lag that is guessed may take one period at the acceleration limit, whatever the joint needs.
    step = 1.01 * scenario.dt * Guards().acceleration(scenario.model)
    assert (np.abs(commands).max(axis=0) < np.maximum(1.3 * peaks(scenario), step)).all()


def test_the_longest_drives_that_are_found():
    """Twelve periods in which nothing moves are no broken sensor."""
    scenario = circle("pr2", 4e-3, seconds=2.0)
    controller, drives = Controller(scenario), Drives(12, 0.04)
    errors, _ = played(controller, with_drives(scenario, drives))
    assert controller.stopped is None
    assert errors[250:].max() < 1e-4
    assert controller.drives.delay == 12
    assert controller.drives.time_constant == pytest.approx(0.04, rel=0.01)


def test_nothing_is_said_of_drives_that_have_not_moved():
    scenario = circle("panda", 4e-3)
    controller, still = Controller(scenario), np.repeat(scenario.nominal()[:1], Controller(scenario).ahead, axis=0)
    for _ in range(200):
        controller.step(scenario.start, None, still)
    assert controller.stopped is None
    assert controller.drives is None
    played(controller, scenario.replace(steps=100))
    assert controller.drives.delay == 0
    assert (controller.drives.time_constant or 0.0) < 0.1 * scenario.dt
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
    on = scenario.replace(plant=with_drives(scenario, Drives(2, LAG)).plant.replace(q_delay=8, pose_delay=8))
    controller = Controller(scenario)
    env = ikgym.RedundantIKEnv(on, preview=controller.ahead)
    seen, _ = env.reset(seed=0)
    for k in range(on.steps):
        ages = {"q_age": seen["q_age"][0], "pose_age": seen["pose_age"][0]}
        qdot = controller.step(seen["q"], seen["pose"], seen["nominal"], **ages)
        seen, *_, info = env.step((qdot / on.velocity_limit).astype(np.float32))
        assert k < 250 or info["position_error"] < 1e-4
    assert controller.drives.delay == 2
