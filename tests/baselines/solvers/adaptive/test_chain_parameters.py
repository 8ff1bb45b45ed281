"""Chains with parameters: the model's where they are 0, and derivatives against central differences."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines.solvers.adaptive.chain_parameters import changed_chain, parameter_twists
from ikgym.kernels.kinematics import forward
from ikgym.kernels.rotations import rotation_vector

STEP = 1e-6


def changed(arm, parameters):
    n = arm.joints
    return changed_chain(arm.chain, parameters, np.empty((n, 3)), np.empty((n, 3)), np.empty(3))


def pose(arm, parameters, q):
    rotation, position = np.empty((3, 3)), np.empty(3)
    forward(changed(arm, parameters), q + parameters[: arm.joints], rotation, position)
    return rotation, position


@pytest.mark.parametrize("name", ["panda", "tiago", "planar2", "puma560"])
def test_twists_are_the_derivatives_of_the_pose(name):
    arm = ikgym.arms.get(name)
    rng = np.random.default_rng(3)
    q, n = rng.uniform(-1.0, 1.0, arm.joints), arm.joints
    none = np.zeros(6 * n + 3)
    position = pose(arm, none, q)[1]
    np.testing.assert_allclose(position, arm.forward(q)[1], atol=1e-15)
    twist = np.zeros((6, len(none)))
    parameter_twists(changed(arm, none), q, position, twist)
    for i in range(len(none)):
        change = np.zeros_like(none)
        change[i] = STEP
        (above, up), (below, down) = pose(arm, change, q), pose(arm, -change, q)
        turned = rotation_vector(above @ below.T)
        np.testing.assert_allclose(twist[:, i], np.concatenate([up - down, turned]) / (2.0 * STEP), atol=1e-8)


def test_axes_stay_unit_vectors():
    arm = ikgym.arms.get("panda")
    chain = changed(arm, np.full(45, 0.1))
    np.testing.assert_allclose(np.linalg.norm(chain.axes, axis=1), 1.0, atol=1e-15)
