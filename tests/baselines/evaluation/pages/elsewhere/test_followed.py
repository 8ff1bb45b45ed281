"""How a joint path follows waypoints, and the thresholds."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import ikgym
from baselines.evaluation.pages.elsewhere.followed import Followed, followed
from ikgym import problems
from ikgym.problems import Waypoints
from tests.pinocchio_models import model_of, tool_state

GOOD = Followed(0.99e-4, math.radians(0.099), math.radians(6.99), 0.0199, 0.0, 10.0)


@pytest.mark.parametrize(
    ("field", "threshold"),
    [
        ("position_error", 1e-4),
        ("orientation_error", math.radians(0.1)),
        ("turn", math.radians(7.0)),
        ("slide", 0.02),
    ],
)
def test_each_threshold_has_to_be_undercut(field, threshold):
    assert GOOD.passes
    assert dataclasses.replace(GOOD, **{field: np.nextafter(threshold, 0.0)}).passes
    assert not dataclasses.replace(GOOD, **{field: threshold}).passes


def test_limits_have_to_be_kept_and_the_length_does_not_matter():
    assert not dataclasses.replace(GOOD, beyond=1e-15).passes
    assert dataclasses.replace(GOOD, length=1e6).passes


@pytest.mark.parametrize(
    ("name", "method"),
    [("rlitg-hello", "reinforcement"), ("rlitg-rotation", "greedy"), ("rlitg-random-041", "cloning")],
)
def test_pinocchio_agrees(name, method):
    arm, q, waypoints = ikgym.arms.get("fetch_arm"), problems.trajectory(name, method), problems.waypoints(name)
    model, frame = model_of(arm)
    wanted = Rotation.from_quat(waypoints.quaternions, scalar_first=True).as_matrix()
    states = [tool_state(model, frame, one) for one in q]
    away = [np.linalg.norm(state.position - one) for state, one in zip(states, waypoints.positions, strict=True)]
    turned = [np.linalg.norm(pin.log3(state.rotation.T @ one)) for state, one in zip(states, wanted, strict=True)]
    found = followed(arm, q, waypoints)
    assert found.position_error == pytest.approx(max(away), rel=1e-12)
    assert found.orientation_error == pytest.approx(max(turned), rel=1e-9)
    changes = np.abs(Rotation.from_rotvec(np.diff(q, axis=0).reshape(-1, 1) * [1.0, 0.0, 0.0]).as_rotvec()[:, 0])
    assert found.turn == pytest.approx(changes.max(), rel=1e-12)
    assert found.length == pytest.approx(changes.sum(), rel=1e-12)


def test_torso_limits_and_full_turns():
    arm = ikgym.arms.get("fetch")
    q = np.tile(arm.home, (3, 1))
    q[1:, 0] += 0.015
    q[2, 1] = arm.upper[1] + 1e-6
    q[1:, 3] += 2.0 * np.pi + 0.01  # turns without end
    rotations, positions = arm.forward(q)
    quaternions = Rotation.from_matrix(rotations).as_quat(scalar_first=True)
    found = followed(arm, q, Waypoints(positions, quaternions, np.empty((0, 8))))
    assert found.position_error == 0.0
    assert found.orientation_error < 1e-15
    assert found.slide == pytest.approx(0.015, abs=1e-15)
    assert found.turn == pytest.approx(q[2, 1], abs=1e-14)
    assert found.length == pytest.approx(q[2, 1] + 0.01, abs=1e-14)
    assert found.beyond == pytest.approx(1e-6, rel=1e-6)


def test_small_angles_are_not_lost():
    arm = ikgym.arms.get("fetch_arm")
    rotation, position = arm.forward(arm.home)
    turned = Rotation.from_matrix(rotation) * Rotation.from_rotvec([1e-9, 0.0, 0.0])
    waypoints = Waypoints(position[None], turned.as_quat(scalar_first=True)[None], np.empty((0, 7)))
    assert followed(arm, arm.home[None], waypoints).orientation_error == pytest.approx(1e-9, rel=1e-5)
