"""A trajectory in another time."""

from __future__ import annotations

import numpy as np

import ikgym
from ikgym.trajectories import RetimedTrajectory

SCENARIO = ikgym.scenarios.get("panda-square")
BASE = SCENARIO.trajectory
# Rates 0, 1, 1 at 0, 2, 4 s: progress t²/4, then t - 1.
TIMES, PROGRESS, RATES = [0.0, 2.0, 4.0], [0.0, 1.0, 3.0], [0.0, 1.0, 1.0]
SLOWER = RetimedTrajectory(BASE, TIMES, PROGRESS, RATES)


def test_poses_are_those_of_the_other_trajectory():
    times = np.linspace(0.0, 5.0, 101)
    expected = np.where(times < 2.0, times**2 / 4.0, np.minimum(times - 1.0, 3.0))
    np.testing.assert_allclose(SLOWER.base_times(times), expected, atol=1e-14)
    np.testing.assert_array_equal(
        SLOWER.frames(times, SCENARIO.arm), BASE.frames(SLOWER.base_times(times), SCENARIO.arm)
    )
    assert SLOWER.duration == 4.0
    assert SLOWER.has_orientation
