"""Receding horizons of few Newton steps on servos that do not do as commanded."""

import dataclasses

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from ikgym.simulator import Simulator

STEPS = 400


def largest_error(name, **parameters):
    """In [m], on joints that follow the position that commands add up to by a second order of 8 Hz, damped by 0.7."""
    scenario = ikgym.scenarios.get("panda-random").replace(steps=STEPS, dt=0.002)
    policy, (seed,) = baselines.make(name, scenario, **parameters), ikgym.scenarios.seeds("validation", 1)
    simulator = Simulator(scenario, None, policy.preview)
    simulator.reset(np.ones(1, np.bool_), [np.random.default_rng(seed)])
    q, omega, h = simulator.observe().q.copy(), 2 * np.pi * 8.0, 0.25 * scenario.dt  # the servo at 2 kHz
    goal, speed, command, state = q, np.zeros_like(q), np.zeros(q.shape[1]), None
    nominal, errors = scenario.nominal(seed, policy.preview), []
    for k in range(STEPS):
        shown = {"q": q[0], "qdot": command, "pose": policy.problem.poses(q)[0]}
        shown |= {"nominal": nominal[k + 1 :][: policy.preview], "remaining": np.array([float(STEPS - k)])}
        action, state = policy.predict(shown, state)
        command = action * scenario.velocity_limit
        for _ in range(4):
            goal = goal + h * command
            speed = speed + h * (omega**2 * (goal - q) + 1.4 * omega * (0.7 * command - speed))
            q = q + h * speed
        errors.append(np.linalg.norm(policy.problem.poses(q)[0, -3:] - nominal[k + 1, -3:]))
    return max(errors)


@pytest.mark.parametrize(("name", "parameters"), [("rhc", {"iterations": 1}), ("rhc_foresight", {})])
def test_a_servo_of_second_order_does_not_make_plans_diverge(name, parameters):
    assert largest_error(name, **parameters) < 5.0 * largest_error("qp")


def test_errors_without_a_servo_are_what_the_cost_trades_for_slower_joints():
    """On an ideal arm `qp` errs less at a larger cost; where errors weigh 2,500 times more, neither holds."""
    scenario, (seed,) = ikgym.scenarios.get("panda-random"), ikgym.scenarios.seeds("validation", 1)
    scenario = scenario.replace(steps=STEPS, dt=0.002)
    heavy = scenario.replace(cost=dataclasses.replace(scenario.cost, delta_x=scenario.cost.delta_x / 50.0))
    parts = [(scenario, "qp", {}), (scenario, "rhc", {"iterations": 1}), (heavy, "rhc", {"iterations": 1})]
    qp, rhc, exact = (rollout(one, baselines.make(name, one, **more), seed) for one, name, more in parts)
    assert rhc.cost.sum() < 0.95 * qp.cost.sum()
    assert rhc.position_error.max() > 10.0 * qp.position_error.max()
    assert exact.position_error.max() < 0.1 * qp.position_error.max()
    assert exact.velocity_cost.sum() < 0.95 * qp.velocity_cost.sum()
