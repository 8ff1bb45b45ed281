"""The reference on its way to a target."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.viewer.approach import Approach, Pose
from ikgym.kernels.rotations import geodesic_angle, rodrigues

SHIFT, TURN = 0.01, 0.05
START = Pose(np.eye(3), np.array([0.1, 0.2, 0.3]))
AXIS = np.array([0.0, 0.6, 0.8])
#: Distance in [m], angle in [rad], and the steps that they take.
WAYS = [(0.5, 0.0, 50), (0.0, 1.0, 20), (0.5, 1.0, 50), (0.1, 2.0, 40)]


def approach(distance, angle):
    out = Approach(START, SHIFT, TURN)
    target = Pose(rodrigues(AXIS, angle), START.position + np.array([distance, 0.0, 0.0]))
    out.aim(target)
    return out, target


def near(pose, other):
    np.testing.assert_allclose(pose.position, other.position, atol=1e-12)
    np.testing.assert_allclose(pose.rotation, other.rotation, atol=1e-12)


@pytest.mark.parametrize(("distance", "angle", "steps"), WAYS)
def test_it_arrives_after_the_steps_that_the_slower_part_needs(distance, angle, steps):
    way, target = approach(distance, angle)
    near(way.pose, START)
    for _ in range(steps - 1):
        way.advance()
    left = np.linalg.norm(target.position - way.pose.position) + geodesic_angle(target.rotation, way.pose.rotation)
    assert left > 1e-3
    for _ in range(3):
        way.advance()
        near(way.pose, target)


def test_it_goes_straight_and_evenly():
    way, _ = approach(0.5, 1.0)
    rotations, positions = way.ahead(range(1, 51))
    np.testing.assert_allclose(np.diff(positions, axis=0), np.tile([SHIFT, 0.0, 0.0], (49, 1)), atol=1e-12)
    np.testing.assert_allclose(rotations[24], rodrigues(AXIS, 0.5), atol=1e-12)


def test_what_is_ahead_comes_true():
    way, _ = approach(0.3, 0.4)
    rotations, positions = way.ahead([1, 7])
    way.advance()
    near(way.pose, Pose(rotations[0], positions[0]))
    for _ in range(6):
        way.advance()
    near(way.pose, Pose(rotations[1], positions[1]))


def test_a_new_target_does_not_make_it_jump():
    way, _ = approach(0.5, 1.0)
    for _ in range(10):
        way.advance()
    before = way.pose
    way.aim(Pose(np.eye(3), np.array([0.1, 0.9, 0.3])))
    near(way.pose, before)
    assert np.linalg.norm(way.ahead([1])[1][0] - before.position) <= SHIFT + 1e-12


def test_it_can_be_put_elsewhere():
    way, target = approach(0.5, 1.0)
    way.place(target)
    near(way.pose, target)
    way.advance()
    near(way.pose, target)
