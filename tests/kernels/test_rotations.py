import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ikgym.kernels.rotations import geodesic_angle, quaternion, rodrigues, rotation_vector

# Along and between the coordinate axes, with both signs, and nearly along one.
AXES = [
    np.array(axis) / np.linalg.norm(axis)
    for axis in (
        *(sign * row for sign in (1.0, -1.0) for row in np.eye(3)),
        (1, 1, 0), (-1, 1, 0), (0, 1, -1), (-1, 0, -1),
        (1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, -1),
        (0.3, -0.5, 0.8), (-0.9, 0.1, -0.2), (1, 1e-9, 0), (-1e-9, 1e-9, -1),
    )
]  # fmt: skip
TINY = [1e-150, 1e-16, 1e-12, 1e-9, 1e-8, 3e-6, 1e-3]
MIDDLE = [0.1, 1.0, math.pi / 2, 2.0, 2 * math.pi / 3, 3.0]
NEAR_HALF_TURN = [math.pi - d for d in (1e-3, 1e-6, 1e-9, 1e-12)]

every_axis = pytest.mark.parametrize("axis", AXES, ids=lambda axis: np.array2string(axis, precision=1))

unit_vectors = (
    st.tuples(*3 * [st.floats(-1, 1)])
    .map(np.array)
    .filter(lambda v: np.linalg.norm(v) > 1e-3)
    .map(lambda v: v / np.linalg.norm(v))
)


@every_axis
def test_rodrigues_is_the_rotation_about_an_axis(axis):
    angles = np.array([0.0, *TINY, *MIDDLE, *NEAR_HALF_TURN, math.pi, 5.0, -0.7, -math.pi, 100.0])
    got = np.array([rodrigues(axis, angle) for angle in angles])
    vectors = angles[:, None] * axis
    np.testing.assert_allclose(got, Rotation.from_rotvec(vectors).as_matrix(), rtol=0, atol=3e-14)


@every_axis
def test_the_rotation_vector_of_a_tiny_angle_keeps_all_its_digits(axis):
    for angle in (*TINY, *MIDDLE, *NEAR_HALF_TURN):
        got = rotation_vector(rodrigues(axis, angle))
        np.testing.assert_allclose(got, angle * axis, rtol=0, atol=1e-15 * angle if angle in TINY else 5e-15)


@every_axis
def test_rotation_vector_at_a_half_turn_is_the_axis_up_to_its_sign(axis):
    exact = 2 * np.outer(axis, axis) - np.eye(3)
    vector = rotation_vector(exact)
    assert np.linalg.norm(vector) == pytest.approx(math.pi, abs=1e-14)
    assert abs(vector @ axis) == pytest.approx(math.pi, abs=1e-14)


@given(unit_vectors, st.floats(0, math.pi))
def test_rotation_vector_and_rodrigues_undo_each_other(axis, angle):
    rotation = rodrigues(axis, angle)
    vector = rotation_vector(rotation)
    length = np.linalg.norm(vector)
    assert length <= math.pi + 1e-15
    assert length == pytest.approx(angle, abs=1e-14)
    again = rodrigues(vector / length, length) if length > 0 else np.eye(3)
    np.testing.assert_allclose(again, rotation, rtol=0, atol=1e-14)


@given(unit_vectors, st.floats(-math.pi, math.pi))
def test_quaternion_is_of_unit_length_with_its_real_part_not_negative(axis, angle):
    got = np.array(quaternion(rodrigues(axis, angle)))
    sign = math.copysign(1.0, math.cos(angle / 2))
    expected = sign * np.array([math.cos(angle / 2), *(math.sin(angle / 2) * axis)])
    assert got[0] >= 0
    assert np.linalg.norm(got) == pytest.approx(1, abs=1e-15)
    # At a half turn both signs are right.
    assert min(np.abs(got - expected).max(), np.abs(got + expected).max() if got[0] < 1e-12 else np.inf) < 1e-14


@every_axis
def test_geodesic_angle_from_the_identity_keeps_all_its_digits(axis):
    for angle in (0.0, *TINY, *MIDDLE, *NEAR_HALF_TURN, math.pi):
        rotation = rodrigues(axis, angle)
        for ends in ((np.eye(3), rotation), (rotation, np.eye(3))):
            assert geodesic_angle(*ends) == pytest.approx(angle, rel=3e-15, abs=0)


@given(unit_vectors, st.floats(-math.pi, math.pi))
def test_geodesic_angle_to_itself_is_exactly_zero(axis, angle):
    rotation = rodrigues(axis, angle)
    assert geodesic_angle(rotation, rotation) == 0.0
