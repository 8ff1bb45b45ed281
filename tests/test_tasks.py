"""Task coordinates, their errors and Jacobians."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ikgym
from ikgym.kernels.axes import SINGULAR

STEP = 1e-6
TOLERANCE = 2e-8  # of central differences, relative to an arm's reach


def configurations(arm):
    """Random ones, home, stretched and bent ones, where the Jacobian loses rank."""
    n = arm.joints
    rng = np.random.default_rng(n)
    return [*rng.uniform(-3, 3, (4, n)), np.zeros(n), np.full(n, np.pi / 2), np.eye(n)[n // 2] * np.pi]


def differences(function, q):
    shifts = STEP * np.eye(len(q))
    return np.array([(function(q + shift) - function(q - shift)) / (2 * STEP) for shift in shifts]).T


@pytest.mark.parametrize("arm", ikgym.arms.names())
def test_jacobians_against_central_differences(arm):
    for task in ikgym.tasks.names():
        check_jacobians(ikgym.arms.get(arm), ikgym.tasks.get(task))


def check_jacobians(arm, task):
    scale = TOLERANCE * (1 + arm.reach(np.full(arm.joints, 3.0)))
    other = np.random.default_rng(5)
    for q in configurations(arm):
        rotation, _, geometric = arm.forward_and_jacobian(q)
        here = task.coordinates(*arm.forward(q))
        jacobian = task.jacobian(rotation, geometric)
        assert jacobian.shape == (task.error_size, arm.joints)
        wanted = -differences(lambda x, here=here: task.error(here, task.coordinates(*arm.forward(x))), q)
        np.testing.assert_allclose(jacobian, wanted, atol=scale)
        nominal = task.coordinates(*arm.forward(q + other.uniform(-0.8, 0.8, arm.joints)))
        wanted = differences(lambda x, to=nominal: task.error(to, task.coordinates(*arm.forward(x))), q)
        np.testing.assert_allclose(task.error_jacobian(nominal, here, jacobian), wanted, atol=10 * scale)


def test_skew_is_the_skew_part():
    """Elements 12, 13 and 23 of O^A, then the position (Varga 2021)."""
    turn = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()
    skew = 0.5 * (turn - turn.T)
    got = ikgym.tasks.get("skew").coordinates(turn, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(got, [skew[0, 1], skew[0, 2], skew[1, 2], 1, 2, 3], atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-4, 1.0, 3.0, np.pi - 1e-9, np.pi])
def test_pose_error_is_the_rotation_vector_between(angle):
    """Near 0 and near π, where the printed arccos and its division fail (Zhang 2020, eq. 52, 53)."""
    task, axis = ikgym.tasks.get("pose"), np.array([2.0, -1.0, 2.0]) / 3
    start = Rotation.from_rotvec([0.4, 0.2, -1.1])
    end = Rotation.from_rotvec(angle * axis) * start
    error = task.error(task.coordinates(end.as_matrix(), [1, 2, 3]), task.coordinates(start.as_matrix(), [0.5, 2, 3]))
    np.testing.assert_allclose(error[:3], [0.5, 0, 0], atol=1e-15)
    vector = error[3:] if angle < np.pi else error[3:] * np.sign(error[3])
    np.testing.assert_allclose(vector, angle * axis, atol=2e-15)


@pytest.mark.parametrize("name", ikgym.tasks.names())
def test_batches_are_row_by_row(name):
    task, arm = ikgym.tasks.get(name), ikgym.arms.get("varga7")
    q = np.random.default_rng(0).uniform(-1, 1, (2, 3, 7))
    rotation, position, geometric = arm.forward_and_jacobian(q)
    coordinates, jacobian = task.coordinates(rotation, position), task.jacobian(rotation, geometric)
    assert coordinates.shape == (2, 3, task.size)
    error = task.error(coordinates[0, 0], coordinates)
    assert error.shape == (2, 3, task.error_size)
    np.testing.assert_array_equal(coordinates[1, 2], task.coordinates(rotation[1, 2], position[1, 2]))
    np.testing.assert_array_equal(jacobian[1, 2], task.jacobian(rotation[1, 2], geometric[1, 2]))
    np.testing.assert_array_equal(error[1, 2], task.error(coordinates[0, 0], coordinates[1, 2]))
    nominal = task.coordinates(*arm.forward(-q))
    got = task.error_jacobian(nominal, coordinates, jacobian)
    assert got.shape == jacobian.shape
    for index in np.ndindex(2, 3):
        wanted = task.error_jacobian(nominal[index], coordinates[index], jacobian[index])
        np.testing.assert_array_equal(got[index], wanted)


AXIS = ikgym.tasks.get("axis")


def frame_with(axis):
    """A rotation whose z axis is the one given, turned about it at random."""
    axis = np.asarray(axis) / np.linalg.norm(axis)
    swing = Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])[0].as_matrix()
    return swing @ Rotation.from_rotvec([0.0, 0.0, 1.3]).as_matrix()


def test_axis_is_the_z_axis_and_the_position():
    turn = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()
    np.testing.assert_array_equal(AXIS.coordinates(turn, [1.0, 2.0, 3.0]), [*turn[:, 2], 1, 2, 3])


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-4, 1e-3, 1.0, 3.0, np.pi - 1e-9])
def test_axis_error_is_as_long_as_the_angle_between(angle):
    rng = np.random.default_rng(3)
    for axis in [*rng.normal(size=(20, 3)), *np.eye(3), *-np.eye(3), np.array(SINGULAR), -np.array(SINGULAR)]:
        start = frame_with(axis)
        turn = Rotation.from_rotvec(angle * start[:, 0]).as_matrix()  # about an axis across
        about = Rotation.from_rotvec(rng.normal() * start[:, 2]).as_matrix()  # about the axis itself: free
        here, there = AXIS.coordinates(about @ start, [0.5, 2, 3]), AXIS.coordinates(turn @ start, [1, 2, 3])
        error = AXIS.error(there, here)
        np.testing.assert_allclose(error[:3], [0.5, 0, 0], atol=1e-15)
        assert np.linalg.norm(error[3:]) == pytest.approx(angle, rel=1e-9, abs=1e-15)
        np.testing.assert_array_equal(AXIS.error(here, here), 0.0)
        opposite = np.concatenate([-there[:3], there[3:]])
        assert np.linalg.norm(AXIS.error(opposite, there)[3:]) == pytest.approx(np.pi, abs=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-5, 9.9e-4, 1.01e-3, 0.3, 2.0, 3.1])
def test_axis_error_has_its_derivative_at_every_angle(angle):
    """Also where a series takes over, and for desired axes on all sides; a random arm of three axes turns the tool."""
    rng = np.random.default_rng(4)
    for axis in [*rng.normal(size=(10, 3)), *-np.eye(3), np.array(SINGULAR)]:
        start = frame_with(axis)
        goal = AXIS.coordinates(Rotation.from_rotvec(angle * start[:, 1]).as_matrix() @ start, np.zeros(3))
        geometric = np.vstack([np.zeros((3, 3)), np.eye(3)])

        def error(vector, goal=goal, start=start):
            return AXIS.error(goal, AXIS.coordinates(Rotation.from_rotvec(vector).as_matrix() @ start, np.zeros(3)))

        jacobian = AXIS.jacobian(start, geometric)
        got = AXIS.error_jacobian(goal, AXIS.coordinates(start, np.zeros(3)), jacobian)
        np.testing.assert_allclose(got, differences(error, np.zeros(3)), atol=3e-8 / (np.pi - angle))
        # Rotation about the axis itself is free.
        np.testing.assert_allclose(got @ start[:, 2], 0.0, atol=1e-12)


def test_axis_error_is_continuous_but_at_one_desired_axis():
    """A desired axis that goes around the singular one in a narrow circle turns the components; elsewhere not."""
    circle = np.linspace(0, 2 * np.pi, 9)[:-1]
    for center, turned in {(0.0, 0.0, -1.0): False, (0.0, 0.0, 1.0): False, SINGULAR: True}.items():
        frame = frame_with(center)
        ring = [frame @ [1e-6 * np.cos(a), 1e-6 * np.sin(a), 1.0] for a in circle]
        here = np.array([*(frame @ [0.1, 0.0, 0.995]), 0, 0, 0])
        here[:3] /= np.linalg.norm(here[:3])
        errors = np.array([AXIS.error([*(z / np.linalg.norm(z)), 0, 0, 0], here)[3:] for z in ring])
        assert bool(np.ptp(errors, axis=0).max() > 0.05) is turned
