"""Trajectories with the poses of another one: in another time, or with a joint motion along it."""

import numpy as np
from scipy.interpolate import CubicSpline

import ikgym
from ikgym.trajectories import JointPath, RetimedTrajectory

CIRCLE = ikgym.scenarios.get("panda-circle")
TIMES = np.array([0.0, 0.4, 0.7, 1.5])
Q = np.random.default_rng(0).normal(size=(4, 7))
MOTION = JointPath(CIRCLE.trajectory, TIMES, Q)


def test_poses_and_joint_coordinates():
    times = np.linspace(0.0, 1.5, 200)
    expected = CubicSpline(TIMES, Q, bc_type="natural")(times)
    np.testing.assert_allclose(MOTION.joint_path(times), expected, atol=1e-12)
    np.testing.assert_array_equal(MOTION.frames(times, CIRCLE.arm), CIRCLE.trajectory.frames(times, CIRCLE.arm))
    assert (np.abs(expected) <= MOTION.joint_bound()).all()
    np.testing.assert_array_equal(MOTION.first_joints(), Q[0])
    slower = RetimedTrajectory(MOTION, [0.0, 3.0], [0.0, 1.5], [0.5, 0.5])
    np.testing.assert_allclose(slower.joint_path(2.0 * times), expected, atol=1e-9)
    assert slower.duration == 2.0 * MOTION.duration
    np.testing.assert_array_equal(slower.first_joints(), Q[0])
    np.testing.assert_array_equal(slower.joint_bound(), MOTION.joint_bound())


def test_poses_in_another_time():
    """Rates 0, 1, 1 at 0, 2, 4 s: progress t²/4, then t - 1."""
    slower = RetimedTrajectory(CIRCLE.trajectory, [0.0, 2.0, 4.0], [0.0, 1.0, 3.0], [0.0, 1.0, 1.0])
    times = np.linspace(0.0, 5.0, 101)
    expected = np.where(times < 2.0, times**2 / 4.0, np.minimum(times - 1.0, 3.0))
    np.testing.assert_allclose(slower.base_times(times), expected, atol=1e-14)
    poses = CIRCLE.trajectory.frames(slower.base_times(times), CIRCLE.arm)
    np.testing.assert_array_equal(slower.frames(times, CIRCLE.arm), poses)
    assert (slower.duration, slower.has_orientation) == (4.0, True)
