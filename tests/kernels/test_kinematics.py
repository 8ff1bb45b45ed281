"""Kinematics of all arms against Pinocchio; Jacobians against central differences are in tests/test_tasks.py."""

import numpy as np
import pinocchio as pin
import pytest

from ikgym import arms
from tests.pinocchio_models import model_of, tool_state

# All arms are of a few metres: rounding of some ten additions and products stays far below.
TOLERANCE = 1e-12

every_arm = pytest.mark.parametrize("arm", [arms.get(name) for name in arms.names()], ids=arms.names())


def random_configurations(arm, count=20, seed=0):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, arm.joints))


def singular_configurations(arm):
    """Home, each joint alone a quarter and a half turn away from it, and wild mixtures of quarter turns."""
    n, quarter = arm.joints, np.pi / 2
    alone = [turn * np.eye(n)[i] for i in range(n) for turn in (-quarter, quarter, np.pi)]
    mixed = quarter * np.random.default_rng(1).integers(-4, 5, (20, n))
    return np.vstack([np.zeros(n), np.full(n, 1e-9), *alone, mixed])


def configurations(arm):
    return np.vstack([random_configurations(arm), singular_configurations(arm)])


@every_arm
def test_forward_kinematics_and_jacobian_agree_with_pinocchio(arm):
    model, frame = model_of(arm)
    for q in configurations(arm):
        rotation, position, jacobian = arm.forward_and_jacobian(q)
        expected = tool_state(model, frame, q)
        np.testing.assert_allclose(rotation, expected.rotation, rtol=0, atol=TOLERANCE)
        np.testing.assert_allclose(position, expected.position, rtol=0, atol=TOLERANCE)
        np.testing.assert_allclose(jacobian, expected.jacobian, rtol=0, atol=TOLERANCE)


@every_arm
def test_a_batch_equals_its_rows_and_all_equals_its_parts_bit_for_bit(arm):
    q = configurations(arm)
    batch = arm.forward_and_jacobian(q)
    for i, row in enumerate(q):
        for whole, single in zip(batch, arm.forward_and_jacobian(row), strict=True):
            np.testing.assert_array_equal(whole[i], single)
    for part, alone in zip(batch, (*arm.forward(q), arm.jacobian(q)), strict=True):
        np.testing.assert_array_equal(part, alone)


@pytest.mark.parametrize("lead", [(), (1,), (0,), (2, 3), (2, 0)], ids=str)
def test_shapes_follow_those_of_q(lead):
    arm = arms.get("varga7")
    q = np.zeros((*lead, arm.joints))
    rotation, position = arm.forward(q)
    assert rotation.shape == (*lead, 3, 3)
    assert position.shape == (*lead, 3)
    assert arm.jacobian(q).shape == (*lead, 6, arm.joints)


@every_arm
def test_the_tool_never_leaves_its_reach(arm):
    q = random_configurations(arm, 1000)
    _, positions = arm.forward(q)
    assert np.linalg.norm(positions, axis=1).max() <= arm.reach(np.abs(q).max(axis=0))


@every_arm
def test_joint_points_agree_with_pinocchio(arm):
    model, _ = model_of(arm)
    data = model.createData()
    for q in random_configurations(arm, 5):
        points = arm.joint_points(q)
        pin.forwardKinematics(model, data, q)
        after = [placement.translation for placement in data.oMi][1:]
        np.testing.assert_allclose(points[:, 1], after, rtol=0, atol=TOLERANCE)
        travel = np.linalg.norm(points[:, 1] - points[:, 0], axis=1)
        np.testing.assert_allclose(travel, np.where(arm.prismatic, np.abs(q), 0.0), rtol=0, atol=TOLERANCE)


def test_results_are_fresh_and_the_input_stays_as_it_was():
    arm = arms.get("varga7")
    q = np.linspace(-1, 1, 7)
    before = q.copy()
    first = arm.forward_and_jacobian(q)
    for array in first:
        array[...] = np.nan
    for array in arm.forward_and_jacobian(q):
        assert np.isfinite(array).all()
    np.testing.assert_array_equal(q, before)
