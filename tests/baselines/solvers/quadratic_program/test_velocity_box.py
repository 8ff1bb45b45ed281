"""Bounds of the joint velocities: the farthest that braking allows, and never in contradiction."""

import numpy as np
import pytest

import ikgym
from baselines.policy import Problem
from baselines.solvers.quadratic_program.velocity_box import braking_speed, velocity_box

DT, CHANGE = 0.1, 0.2


def way(speed, change):
    """Velocities that a braking joint has, in sum."""
    return sum(max(speed - k * change, 0.0) for k in range(int(speed / change) + 2))


def test_braking_speed_is_the_largest_that_can_brake():
    rng = np.random.default_rng(0)
    rooms = [0.0, CHANGE, 3 * CHANGE, 6 * CHANGE, *rng.uniform(0, 50, 200), *10 ** rng.uniform(-9, 3, 50)]
    for room in rooms:
        speed = braking_speed(room, CHANGE)
        assert way(speed, CHANGE) == pytest.approx(room, rel=1e-10, abs=1e-15)
    assert braking_speed(3.0, np.inf) == 3.0
    assert braking_speed(np.inf, CHANGE) == np.inf == braking_speed(np.inf, np.inf)


def box(q, last, lower=-1.0, upper=1.0, fastest=2.0, change=CHANGE):
    limits, bounds = np.array([[lower], [upper], [fastest], [change], [change]]), np.empty((2, 1))
    velocity_box(limits, DT, np.array([q]), np.array([last]), bounds[0], bounds[1])
    return tuple(bounds[:, 0])


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({"q": 0.0, "last": 0.0}, (-0.2, 0.2)),
        ({"q": 0.0, "last": 0.0, "change": np.inf}, (-2.0, 2.0)),
        ({"q": 0.9, "last": 0.0, "change": np.inf}, (-2.0, 1.0)),  # in one step at the stop
        ({"q": 0.95, "last": 0.3}, (0.1, 0.35)),  # 0.35 + 0.15 = 0.5
        ({"q": 1.0, "last": 0.0}, (-0.2, 0.0)),
        ({"q": -1.0, "last": 0.0}, (0.0, 0.2)),
        ({"q": 0.0, "last": 0.0, "lower": -np.inf, "upper": np.inf}, (-0.2, 0.2)),
        ({"q": 9.0, "last": 0.5, "lower": -np.inf, "upper": np.inf, "change": np.inf}, (-2.0, 2.0)),
        # In contradiction the acceleration limit wins: as hard as it can.
        ({"q": 0.95, "last": 1.0}, (0.8, 0.8)),
        ({"q": 0.0, "last": 3.0}, (2.8, 2.8)),
        # Beyond a stop: back at once, or as fast as limits allow.
        ({"q": 1.01, "last": 0.0}, (-0.2, -0.1)),
        ({"q": 1.5, "last": 0.0, "change": np.inf}, (-2.0, -2.0)),
        ({"q": -1.5, "last": 0.0}, (0.2, 0.2)),
        ({"q": 1.05, "last": -0.4, "change": 0.3}, (-0.7, -0.4)),  # 0.4 + 0.1 = 0.5
        ({"q": 1.05, "last": -0.4, "lower": 1.03, "change": 0.3}, (-0.4, -0.4)),  # the other stop gives way
    ],
)
def test_bounds(given, wanted):
    assert box(**given) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("name", ["panda", "tiago", "gen3"])
def test_no_choice_of_velocities_within_bounds_meets_a_limit(name):
    """From starts at and near the stops, at either end of the bounds or between, whatever float32 makes of it."""
    arm = ikgym.arms.get(name)
    rng = np.random.default_rng(1)
    trajectory = ikgym.trajectories.Sinusoid(np.zeros(arm.joints), offset=arm.home)
    scenario = ikgym.Scenario("any", arm, ikgym.tasks.get("pose"), trajectory, dt=0.004, steps=600)
    env, rows = ikgym.RedundantIKEnv(scenario), Problem.of(scenario).limits
    lower, upper = np.empty(arm.joints), np.empty(arm.joints)
    near = np.where(np.isfinite(arm.lower), arm.lower, -1.0), np.where(np.isfinite(arm.upper), arm.upper, 1.0)
    for share in (0.0, 1e-6, 0.3):
        seen, _ = env.reset(options={"q": near[0] + share * (near[1] - near[0])})
        direction = rng.integers(0, 2, arm.joints).astype(float)
        for k in range(scenario.steps):
            velocity_box(rows, scenario.dt, seen["q"], seen["qdot"], lower, upper)
            assert (lower <= upper).all()
            if k % 100 == 0:
                direction = rng.choice([0.0, 1.0, rng.random()], arm.joints)
            qdot = lower + direction * (upper - lower)
            seen, *_, info = env.step((qdot / scenario.velocity_limit).astype(np.float32))
            assert info["at_limit"].tolist() == [0, 0, 0]
