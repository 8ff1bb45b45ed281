"""Task coordinates, their errors and Jacobians."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ikgym
from ikgym.exceptions import InvalidInputError, UnknownNameError

STEP = 1e-6
TOLERANCE = 2e-8  # of central differences, relative to an arm's reach


def configurations(arm):
    """Random ones, home, stretched and folded ones, where the Jacobian loses rank."""
    n = arm.joints
    rng = np.random.default_rng(n)
    return [*rng.uniform(-3, 3, (4, n)), np.zeros(n), np.full(n, np.pi / 2), np.eye(n)[n // 2] * np.pi]


def differences(function, q):
    shifts = STEP * np.eye(len(q))
    return np.array([(function(q + shift) - function(q - shift)) / (2 * STEP) for shift in shifts]).T


@pytest.mark.parametrize("task", ikgym.tasks.names())
@pytest.mark.parametrize("arm", ikgym.arms.names())
def test_jacobians_against_central_differences(arm, task):
    arm, task = ikgym.arms.get(arm), ikgym.tasks.get(task)
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


def test_matrix_and_pose_share_their_coordinates():
    turn = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()
    for name in ("matrix", "pose"):
        got = ikgym.tasks.get(name).coordinates(turn, [1.0, 2.0, 3.0])
        np.testing.assert_array_equal(got, [*turn.ravel(), 1, 2, 3])


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


def test_bad_input():
    task = ikgym.tasks.get("skew")
    with pytest.raises(UnknownNameError, match=r"no task 'skwe'\. Did you mean 'skew'\?"):
        ikgym.tasks.get("skwe")
    with pytest.raises(InvalidInputError, match=r"rotation: expected shape \(\.\.\., 3, 3\), got \(3,\)"):
        task.coordinates(np.zeros(3), np.zeros(3))
    with pytest.raises(InvalidInputError, match=r"rotation: expected shape \(2, 3, 3\)"):
        task.coordinates(np.eye(3), np.zeros((2, 3)))
    with pytest.raises(InvalidInputError, match=r"nominal: expected shape \(\.\.\., 6\), got \(5,\)"):
        task.error(np.zeros(5), np.zeros(6))
    with pytest.raises(InvalidInputError, match=r"coordinates: expected a shape that goes with \(4, 6\)"):
        task.error(np.zeros((4, 6)), np.zeros((3, 6)))
    with pytest.raises(InvalidInputError, match="coordinates: expected finite numbers"):
        task.error(np.zeros(6), np.full(6, np.nan))
    with pytest.raises(InvalidInputError, match="jacobian: expected shape"):
        task.jacobian(np.eye(3), np.zeros((5, 7)))


@pytest.mark.parametrize("name", ikgym.tasks.names())
def test_error_jacobians_of_a_batch_are_those_of_its_rows(name):
    task, arm, rng = ikgym.tasks.get(name), ikgym.arms.get("varga7"), np.random.default_rng(4)
    rotation, position, geometric = arm.forward_and_jacobian(rng.normal(size=(2, 3, 7)))
    nominal = task.coordinates(*arm.forward(rng.normal(size=(2, 3, 7))))
    here, jacobian = task.coordinates(rotation, position), task.jacobian(rotation, geometric)
    got = task.error_jacobian(nominal, here, jacobian)
    assert got.shape == jacobian.shape
    for index in np.ndindex(2, 3):
        np.testing.assert_array_equal(got[index], task.error_jacobian(nominal[index], here[index], jacobian[index]))
    with pytest.raises(InvalidInputError, match=r"jacobian: expected shape .*'n'.*, as the error has"):
        task.error_jacobian(nominal, here, jacobian[0, 0])
    with pytest.raises(InvalidInputError, match="jacobian: expected shape"):
        task.error_jacobian(nominal[0, 0], here[0, 0], 3.0)
