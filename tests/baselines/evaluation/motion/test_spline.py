"""Motions of steps as points of a cubic Hermite spline: where it goes, how hard it accelerates, how it ends."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import ikgym
from baselines.evaluation.motion.spline import FEWEST, accelerations, smooth, stop
from ikgym.exceptions import InvalidInputError

DT = 1e-3
TIMES = DT * np.arange(2001)
PANDA = ikgym.arms.get("panda")


def quintic(times):
    u = np.clip(times / 1.8, 0.0, 1.0)
    return u**3 * (10.0 + u * (6.0 * u - 15.0))


def trapezoid(times):
    return np.interp(times, [0, 0.4, 1.4, 1.8, 9], [0, 2.0, 2.0, 0, 0])


def summed(steps):
    """Coordinates of velocities step by step, from rest. Shape (k + 1, 1)."""
    return np.concatenate([[0.0], DT * np.cumsum(steps)])[:, None]


def bang_bang(seed):
    """Velocities that change by the same amount in each step, up or down, and stop in the end."""
    rng = np.random.default_rng(seed)
    changes = 0.01 * np.repeat(rng.choice([-1.0, 0.0, 1.0], 100), rng.integers(1, 40, 100))
    speeds = np.cumsum(changes)
    rest = np.linspace(speeds[-1], 0.0, int(abs(speeds[-1]) / 0.01) + 2)[1:]
    return summed(np.concatenate([speeds, rest, np.zeros(3)]))


MOTIONS = {
    "smooth": quintic(TIMES)[:, None],
    "acceleration jumps": np.cumsum(DT * 0.5 * (trapezoid(TIMES) + trapezoid(TIMES - DT)))[:, None],
    "velocity jumps": summed(trapezoid(TIMES[1:])),
    "at once": summed(np.concatenate([np.full(500, 0.3), np.zeros(500)])),
    "short": quintic(0.15 * np.arange(15))[:, None],
    **{f"bang-bang {seed}": bang_bang(seed) for seed in range(20)},
}


@pytest.mark.parametrize("q", MOTIONS.values(), ids=MOTIONS)
def test_the_spline_accelerates_as_hard_as_the_motion_and_stays_with_it(q):
    points = smooth(q, DT)
    times = DT * np.arange(len(points.q))
    spline = CubicHermiteSpline(times, points.q, points.qdot)
    ends = np.vstack([spline(times[:-1] + 1e-9, 2), spline(times[1:] - 1e-9, 2)])
    hardest = np.abs(np.diff(q[:, 0], 2, prepend=q[0, 0])).max() / DT**2
    assert np.abs(ends).max() <= 1.1 * hardest
    np.testing.assert_allclose(accelerations(points, DT), np.abs(ends).max(axis=0), rtol=1e-5)
    fine = np.arange(0.0, DT * (len(q) - 1), 1e-4)
    late = DT * (len(points.q) - len(q))  # a wait of one period
    apart = np.abs(spline(fine + late)[:, 0] - np.interp(fine, DT * np.arange(len(q)), q[:, 0])).max()
    assert apart <= 4.0 * hardest * DT**2
    np.testing.assert_array_equal(points.q[[0, -1]], q[[0, -1]])
    assert not points.qdot[[0, -1]].any()
    assert not points.qddot[-1].any()


def test_gradual_motions_are_met_to_the_last_digit_and_on_time():
    q = MOTIONS["smooth"]
    points = smooth(q, DT)
    np.testing.assert_array_equal(points.q, q)
    fine = np.linspace(0.0, 2.0, 20001)
    spline = CubicHermiteSpline(TIMES, points.q, points.qdot)
    np.testing.assert_allclose(spline(fine)[:, 0], quintic(fine), rtol=0, atol=1e-9)
    assert len(smooth(MOTIONS["velocity jumps"], DT).q) == 2001


def moving(speed, joint=0, sign=1.0):
    """The Panda from its home, one joint faster and faster up to a speed."""
    q = np.tile(PANDA.home, (401, 1))
    q[:, joint] += sign * DT * np.cumsum(np.linspace(0.0, speed, 401))
    return q


def test_a_motion_is_continued_to_rest_no_harder_than_it_began():
    q = moving(1.2)
    out = stop(PANDA, q, DT)
    np.testing.assert_array_equal(out[: len(q)], q)
    np.testing.assert_array_equal(out[-1], out[-2])
    changes = np.diff(out, 2, axis=0) / DT**2
    assert np.abs(changes).max() <= 1.2 / 0.4 * (1 + 1e-9)
    assert np.abs(changes[-1]).max() < 0.1
    points = smooth(out, DT)
    assert np.abs(points.qdot[-1]).max() == 0.0
    np.testing.assert_array_equal(stop(PANDA, out, DT), out)
    assert len(stop(PANDA, moving(1e-9), DT)) >= len(q) + FEWEST


def test_a_motion_without_room_to_stop_is_refused_with_its_joint():
    message = (
        "joint 'panda_joint4' moves at -1.5 rad/s at the end, and would stop at "
        r"-\d\.\d+ rad, beyond its limits -3.072 to -0.0698; more steps"
    )
    q = moving(1.5, joint=3, sign=-1.0)
    q[:, 3] += PANDA.lower[3] + 0.05 - q[-1, 3]
    with pytest.raises(InvalidInputError, match=message):
        stop(PANDA, q, DT)
