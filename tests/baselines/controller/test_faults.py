"""Random faults in the loop: no command beyond the limits, no error, and a stop where one is due."""

from __future__ import annotations

import numpy as np
import pytest

from baselines import Controller, Drives
from docs.loop import DrivenArm
from tests.baselines.controller.circles import circle

DRIVES, WARM, AFTER = Drives(2, 0.02), 150, 60


# What each fault makes of a measurement, and whether a stop is due: None where it may be or not.


def not_finite(rng, q, past):
    out = q.copy()
    out[rng.integers(len(q))] = rng.choice([np.nan, np.inf, -np.inf])
    return {"q": out}, True


def stale(rng, q, past):
    age = int(rng.integers(1, 40))
    return {"q": past[-1 - age], "q_age": age}, age > 10


def jump(rng, q, past):
    size = 10.0 ** rng.uniform(-3, 3)
    return {"q": q + size * rng.choice([-1.0, 1.0], len(q))}, True if size > 0.03 else None


def outside(rng, q, past):
    out = q.copy()
    out[rng.integers(len(q))] = rng.choice([-1.0, 1.0]) * rng.uniform(7.0, 1e6)
    return {"q": out}, True


def swapped(rng, q, past):
    out, (i, j) = q.copy(), rng.choice(len(q), 2, replace=False)
    out[[i, j]] = q[[j, i]]
    return {"q": out}, True if abs(q[i] - q[j]) > 0.05 else None


def dropped(rng, q, past):
    return int(rng.integers(1, 30)), None


def wrong_pose(rng, q, past):
    return {"pose": np.r_[np.eye(3).ravel(), 10.0 ** rng.uniform(0, 200) * rng.standard_normal(3)]}, True


FAULTS = (not_finite, stale, jump, outside, swapped, dropped, wrong_pose)


def faulty(scenario, controller, nominal, kind, rng):
    """Plays an episode with a fault of one to three periods: commands, and whether a stop was due, period by period."""
    controller.reset()
    arm, commands, due = DrivenArm(DRIVES, scenario.start, scenario.dt), [np.zeros(scenario.joints)], []
    past = [arm.q.copy()]

    def move():
        """For a period, with the last command where none comes."""
        arm.move(commands[-1])
        past.append(arm.q.copy())

    begin, lasting = WARM + int(rng.integers(0, 100)), int(rng.integers(1, 4))
    for made in range(begin + AFTER):
        seen = {"q": past[-1], "pose": None}
        if made >= begin and len(due) < lasting:
            fault, so = kind(rng, past[-1], past)
            due.append(so)
            for _ in range(fault if isinstance(fault, int) else 0):
                move()
            seen |= fault if isinstance(fault, dict) else {}
        ahead = nominal[len(past) :][: controller.ahead]
        commands.append(controller.step(seen.pop("q"), seen.pop("pose"), ahead, **seen))
        move()
    return np.array(commands), due


def check(name, number, seed=20):
    rng = np.random.default_rng(seed)
    scenario = circle(name, 4e-3, seconds=2.4)
    controller = Controller(scenario)
    nominal, arm = scenario.nominal(0, controller.ahead), scenario.arm
    for i in range(number):
        kind = FAULTS[i % len(FAULTS)]
        commands, due = faulty(scenario, controller, nominal, kind, rng)
        assert np.isfinite(commands).all()
        assert (np.abs(commands) <= arm.velocity_limit + 1e-9).all(), (i, kind)
        assert (np.abs(np.diff(commands, axis=0)) <= scenario.dt * arm.acceleration_limit + 1e-9).all(), (i, kind)
        stopped = controller.stopped is not None
        assert stopped if any(due) else not stopped or None in due, (i, kind, due)
        assert stopped == (not commands[-1].any())


@pytest.mark.parametrize("name", ["panda", "ur10"])
def test_some_faults(name):
    """An arm with limits of acceleration, and one without."""
    check(name, len(FAULTS))


@pytest.mark.slow
def test_500_faults():
    check("panda", 500, seed=7)
