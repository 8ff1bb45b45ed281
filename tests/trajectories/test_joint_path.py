"""A joint motion along another trajectory: the poses are those of the trajectory."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import ikgym
from ikgym.exceptions import InvalidInputError
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


def test_files_keep_every_number(tmp_path):
    scenario = CIRCLE.replace(trajectory=MOTION.replace(q=np.tile(CIRCLE.start_of(), (4, 1))))
    scenario.save(tmp_path / "motion.toml")
    read = ikgym.scenarios.load(tmp_path / "motion.toml").trajectory
    np.testing.assert_array_equal(read.q, scenario.trajectory.q)
    np.testing.assert_array_equal(read.times, TIMES)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"times": [0.0, 1.0, 1.0, 2.0]}, "times: expected at least two times in .s. that rise from 0"),
        ({"times": [0.1, 1.0, 1.5, 2.0]}, "rise from 0"),
        ({"q": Q[:3]}, "q: expected shape"),
        ({"trajectory": ikgym.scenarios.get("panda-random").trajectory}, "not random"),
    ],
)
def test_bad_input(changes, message):
    with pytest.raises(InvalidInputError, match=message):
        MOTION.replace(**changes)
