"""The papers' arms against the formulas that are printed in the papers."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ikgym import arms

CONFIGURATIONS = np.random.default_rng(0).uniform(-np.pi, np.pi, (20, 8))


@pytest.mark.parametrize("name", ["varga7", "varga7_literal"])
def test_varga_home(name):
    rotation, position, jacobian = arms.get(name).forward_and_jacobian(np.zeros(7))
    np.testing.assert_array_equal(rotation, np.eye(3))
    np.testing.assert_array_equal(position, [5.5, 0, 2])
    assert np.linalg.matrix_rank(jacobian) == 5


def test_varga_read_literally_depends_on_the_sum_of_q4_and_q5_alone():
    arm = arms.get("varga7_literal")
    for q in CONFIGURATIONS[:, :7]:
        shifted = q + np.array([0, 0, 0, 0.7, -0.7, 0, 0])
        for here, there in zip(arm.forward(q), arm.forward(shifted), strict=True):
            np.testing.assert_allclose(here, there, rtol=0, atol=1e-14)


def test_varga_segments_after_joints_as_a_product_of_homogeneous_matrices():
    segments = np.array([[0, 0, 1], [0, 0, 0], [2, 0, 0], [1, 0, 1], [1.5, 0, 0], [0, 0, 0], [0, 0, 0]])
    for q in CONFIGURATIONS[:, :7]:
        pose = np.eye(4)
        for i, (axis, segment) in enumerate(zip("zyyxxyz", segments, strict=True)):
            motion, shift = np.eye(4), np.eye(4)
            if i == 2:
                motion[1, 3] = q[i]
            else:
                motion[:3, :3] = Rotation.from_euler(axis, q[i]).as_matrix()
            shift[:3, 3] = segment
            pose = pose @ motion @ shift
        rotation, position = arms.get("varga7").forward(q)
        np.testing.assert_allclose(rotation, pose[:3, :3], rtol=0, atol=1e-14)
        np.testing.assert_allclose(position, pose @ [1, 0, 0, 1] @ np.eye(4)[:, :3], rtol=0, atol=1e-13)


@pytest.mark.parametrize("q", CONFIGURATIONS[:, :3])
def test_faitli_position_and_jacobian_are_eq_2_and_eq_3(q):
    length1, length2, length3 = 1.5, 0.8, 0.5
    (c1, c2, _), (s1, s2, _) = np.cos(q), np.sin(q)
    c23, s23 = np.cos(q[1] + q[2]), np.sin(q[1] + q[2])
    expected = [
        length3 * c1 * c23 + c1 * c2 * length2,
        length3 * s1 * c23 + s1 * c2 * length2,
        -s23 * length3 - s2 * length2 + length1,
    ]
    expected_jacobian = [
        [-length3 * c23 * s1 - length2 * c2 * s1, -length3 * c1 * s23 - length2 * c1 * s2, -length3 * c1 * s23],
        [length3 * c1 * c23 + c1 * c2 * length2, -length3 * s1 * s23 - s1 * s2 * length2, -length3 * s1 * s23],
        [0, -length3 * c23 - length2 * c2, -length3 * c23],
    ]
    _, position, jacobian = arms.get("faitli3").forward_and_jacobian(q)
    np.testing.assert_allclose(position, expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(jacobian[:3], expected_jacobian, rtol=0, atol=1e-14)


@pytest.mark.parametrize("q", CONFIGURATIONS[:, :2])
def test_planar_position_is_that_of_two_links(q):
    expected = 0.8 * np.exp(1j * q[0]) + 0.5 * np.exp(1j * (q[0] + q[1]))
    np.testing.assert_allclose(arms.get("planar2").forward(q)[1], [expected.real, expected.imag, 0], atol=1e-15)


@pytest.mark.parametrize("q", CONFIGURATIONS[:, :3])
def test_zhang_position_is_eq_42_with_its_parenthesis_in_place(q):
    length1, length2, length3 = 5, 7, 7
    radius = length2 * np.sin(q[1]) + length3 * np.sin(q[1] + q[2])
    height = length1 + length2 * np.cos(q[1]) + length3 * np.cos(q[1] + q[2])
    expected = [radius * np.cos(q[0]), radius * np.sin(q[0]), height]
    np.testing.assert_allclose(arms.get("zhang3").forward(q)[1], expected, rtol=0, atol=1e-14)


def test_khan_exact_axes_are_those_of_table_1():
    table = 2 * np.array(
        [
            (0.10, 0.09, 0.08), (0.02, 0.02, 0.0), (0.02, 0.03, 0.07), (0.08, 0.06, 0.04),
            (0.05, 0.01, 0.07), (0.03, 0.01, 0.06), (0.06, 0.06, 0.08), (0.04, 0.01, 0.10),
        ]
    )  # fmt: skip
    a, b = 1 / np.sqrt(2), 1 / np.sqrt(3)
    printed = np.array([[0, 0, 0, a, a, 0, b, b], [0, 1, 1, 0, 0, 1, b, -b], [1, 0, 0, -a, a, 0, b, b]]).T
    np.testing.assert_allclose(arms.get("khan8_approximate").axes, printed, rtol=0, atol=1e-15)
    # Capital letters: about the axes as they turn, which is the product O1 O2 O3 of the table.
    turned = Rotation.from_euler("XYZ", table).apply(printed)
    np.testing.assert_allclose(arms.get("khan8").axes, turned, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "l1", "l2", "l3", "tool"),
    [("khan8_approximate", 1.0, 1.5, 2.0, (2.5, 2.5, 2.5)), ("khan8", 1.2, 1.8, 2.2, (2.6, 2.4, 2.3))],
)
def test_khan_shifts_are_those_of_eq_3_14_and_eq_3_15(name, l1, l2, l3, tool):
    printed = [[0, l1, l1, l1, l3, l3, l1, l3], [0, 0, 0, 0, 0, l3, -l2, l2], [l1, 0, 0, l2, l3, 0, l3, -l1]]
    np.testing.assert_array_equal(arms.get(name).offsets.T, printed)
    np.testing.assert_array_equal(arms.get(name).tool, tool)


def test_puma_in_its_textbook_postures():
    arm = arms.get("puma560")
    # Upper arm level along x, forearm upright, all of it next to the shoulder.
    np.testing.assert_allclose(
        arm.forward(np.zeros(6))[1], [0.4318 + 0.0203, -0.15005, 0.67183 + 0.4318], rtol=0, atol=1e-15
    )
    # Upper arm upright, forearm level towards the back.
    np.testing.assert_allclose(
        arm.forward([0, np.pi / 2, 0, 0, 0, 0])[1], [-0.4318, -0.15005, 0.67183 + 0.4318 + 0.0203], rtol=0, atol=1e-15
    )
