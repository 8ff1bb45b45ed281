"""Joints at their stops: led back within the acceleration limit, whatever the measurements say."""

from __future__ import annotations

import numpy as np
import pytest

from baselines import Controller, Drives, Guards
from tests.baselines.controller.circles import circle

JOINT, LAG = 3, 0.02
ANY = Guards(position_error=None, orientation_error=None, tolerance=0.02)


def standing(name, dt, beyond):
    """A scenario and a posture with one joint so far beyond its upper stop, in [rad]."""
    scenario = circle(name, dt)
    q = np.array(scenario.start)
    q[JOINT] = scenario.arm.upper[JOINT] + beyond
    return scenario, q


@pytest.mark.parametrize("drives", ["identify", Drives()])
@pytest.mark.parametrize(("beyond", "noise"), [(-1e-4, 1e-3), (9e-3, 0.0), (9e-3, 1e-3)])
def test_the_acceleration_limit_takes_precedence_over_the_stop(drives, beyond, noise):
    """The commands hold the tool where it is; the drives have a lag where they are to be identified."""
    scenario, q = standing("panda", 1e-3, beyond)
    controller, rng = Controller(scenario, drives=drives, guards=ANY), np.random.default_rng(3)
    share = 1.0 if isinstance(drives, Drives) else 1.0 - np.exp(-scenario.dt / LAG)
    there = np.tile(scenario.task.coordinates(*scenario.arm.forward(q)), (controller.ahead, 1))
    change, last, qdot = scenario.dt * scenario.arm.acceleration_limit, np.zeros(7), np.zeros(7)
    for _ in range(400):
        command = controller.step(q + noise * rng.uniform(-1.0, 1.0, 7), None, there)
        assert (np.abs(command - last) <= change + 1e-12).all()
        qdot = qdot + share * (command - qdot)
        q, last = q + scenario.dt * qdot, command
    assert controller.stopped is None
    assert q[JOINT] <= scenario.arm.upper[JOINT] + noise


@pytest.mark.parametrize("jerk", [np.inf, 5000.0])
@pytest.mark.parametrize("policy", ["qp", "sns"])
def test_a_joint_is_led_back_to_its_stop_and_no_farther(policy, jerk):
    """With the tool held beyond it."""
    scenario, q = standing("panda", 1e-3, 9e-3)
    scenario = scenario.replace(jerk_limit=jerk)
    controller = Controller(scenario, policy, Drives(), guards=ANY)
    there = np.tile(scenario.task.coordinates(*scenario.arm.forward(q)), (controller.ahead, 1))
    stop, most, last = scenario.arm.upper[JOINT], scenario.dt * scenario.arm.acceleration_limit, np.zeros((2, 7))
    for _ in range(100):
        command = controller.step(q, None, there)
        assert (np.abs(command - last[0]) <= most + 1e-12).all()
        assert (np.abs(command - 2.0 * last[0] + last[1]) <= scenario.dt**2 * jerk + 1e-12).all()
        q, last = q + scenario.dt * command, np.array([command, last[0]])
        assert q[JOINT] >= stop - 1e-6
    assert q[JOINT] == pytest.approx(stop, abs=1e-6)


def test_a_joint_without_acceleration_limit_is_led_back_as_a_stop_is_made():
    scenario, q = standing("ur10", 4e-3, 9e-3)
    controller = Controller(scenario, guards=ANY)
    there = np.tile(scenario.task.coordinates(*scenario.arm.forward(q)), (controller.ahead, 1))
    most = scenario.dt * scenario.velocity_limit[JOINT] / ANY.stopping_time
    assert -most - 1e-12 <= controller.step(q, None, there)[JOINT] < 0.0


def test_a_policy_that_knows_no_limits_brakes_ahead_of_a_stop():
    """On the way to a pose beyond the stop."""
    scenario = circle("panda", 4e-3)
    controller = Controller(scenario, "dls", Drives(), guards=ANY)
    change = scenario.dt * scenario.arm.acceleration_limit
    goal = np.array(scenario.start)
    goal[5] = scenario.arm.upper[5] + 0.5
    there = scenario.task.coordinates(*scenario.arm.forward(goal))[None]
    q, last = np.array(scenario.start), np.zeros(7)
    for _ in range(500):
        qdot = controller.step(q, None, there)
        assert (np.abs(qdot - last) <= change + 1e-12).all()
        q, last = q + scenario.dt * qdot, qdot
        assert (q <= scenario.arm.upper + 1e-9).all()
        assert (q >= scenario.arm.lower - 1e-9).all()
    assert ((scenario.arm.upper - q < 1e-3) | (q - scenario.arm.lower < 1e-3)).any()


def test_the_arm_that_the_policy_moves_in_predicted_is_led_back_too():
    scenario, q = standing("panda", 1e-3, 9e-3)
    controller = Controller(scenario, guards=ANY)
    there = np.tile(scenario.task.coordinates(*scenario.arm.forward(q)), (controller.ahead, 1))
    change, policy = scenario.dt * scenario.arm.acceleration_limit, controller.policy
    for periods in range(1, 4):
        controller.step(q, None, there)
        outer, _ = policy.split(policy.memory_of(controller._state))
        assert (np.abs(outer.arm_qdot[0, 0]) <= periods * change + 1e-12).all()
        assert outer.arm_qdot[0, 0, JOINT] < 0.0
