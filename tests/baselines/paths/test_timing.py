"""The shortest time of a joint path, against what can be worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.paths.timing import EASE, Timing, grid, shortest
from ikgym.trajectories import Trajectory

FAR = 2.0
VELOCITY, ACCELERATION = np.array([1.0, 3.0]), np.array([4.0, 12.0])


def rest_to_rest(times):
    """Two joints, the second one twice as far, from rest to rest within 1 s."""
    u = np.clip(times, 0.0, 1.0)
    return np.column_stack([FAR * u**3 * (10.0 + u * (6.0 * u - 15.0))]) * np.array([1.0, 2.0])


def timed(velocity, acceleration, **rate):
    times = np.linspace(0.0, 1.0, 1001)
    rows = grid(times, rest_to_rest(times), VELOCITY)
    limits = {"velocity": velocity, "acceleration": acceleration, "dt": 1e-3}
    return shortest(times[rows], rest_to_rest(times)[rows], **limits, **rate)


def joints(timing, dt):
    times = np.arange(0.0, timing.duration + dt, dt)
    base = timing.of(_Any()).base_times(times)
    return rest_to_rest(base)


class _Any(Trajectory):
    """A trajectory of which nothing is asked."""


def test_a_straight_line_takes_a_trapezoid():
    timing = timed(VELOCITY, ACCELERATION)
    trapezoid = FAR / 1.0 + 1.0 / 4.0  # the first joint is the slow one
    assert trapezoid * 0.999 < timing.duration < trapezoid * 1.01
    q = joints(timing, 1e-3)
    velocity, acceleration = np.diff(q, axis=0) / 1e-3, np.diff(q, n=2, axis=0) / 1e-6
    assert (np.abs(velocity).max(axis=0) <= 1.001 * VELOCITY).all()
    assert (np.abs(acceleration).max(axis=0) <= 1.06 * ACCELERATION).all()
    np.testing.assert_allclose(q[-1], [FAR, 2.0 * FAR], atol=1e-9)


def test_velocities_alone():
    timing = timed(VELOCITY, np.full(2, np.inf))
    assert FAR * 0.999 < timing.duration < FAR * 1.02


def test_nowhere_faster_than_asked():
    timing = timed(10.0 * VELOCITY, 100.0 * ACCELERATION, rate=1.0)
    assert timing.duration == pytest.approx(1.0, rel=5e-3)
    assert timing.rates.max() <= 1.0 + 1e-9


def test_the_same_in_another_time():
    timing = Timing.uniform(3.0, 2.0)
    assert timing.duration == 6.0
    np.testing.assert_array_equal(timing.of(_Any()).base_times(np.array([0.0, 3.0, 6.0])), [0.0, 1.5, 3.0])
    assert timing.slower(1.5).duration == 9.0


@pytest.mark.parametrize("duration", [2.0, 0.05])
def test_a_timing_that_is_eased_in(duration):
    """It begins at rest, takes half of the ease longer, and is the same after it; also where it ends within it."""
    before = Timing.uniform(duration, 1.0)
    eased, ease = before.eased_in(), min(EASE, duration)
    assert eased.duration == pytest.approx(duration + 0.5 * ease)
    assert eased.rates[0] == 0.0
    times = np.linspace(0.0, eased.duration, 500)
    base = eased.of(_Any()).base_times(times)
    rates = np.diff(base) / np.diff(times)
    assert (rates >= 0.0).all()
    assert rates.max() < 1.0 + 1e-6
    assert np.abs(np.diff(rates)).max() < 2.0 * times[1] / ease  # 1.5 is the steepest slope of a smooth rise
    later = times >= ease
    np.testing.assert_allclose(base[later], times[later] - 0.5 * ease, atol=1e-9)
