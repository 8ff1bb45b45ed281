"""Readings of a posture."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines.viewer.readings import AT, FREE, NEAR, Reader, slider_range


@pytest.fixture(scope="module")
def panda():
    return ikgym.arms.get("panda")


@pytest.fixture(scope="module")
def reader(panda):
    return Reader(panda, ikgym.tasks.get("pose"))


def test_manipulability_is_the_root_of_the_determinant(panda, reader):
    jacobian = panda.jacobian(panda.home)
    wanted = np.sqrt(np.linalg.det(jacobian @ jacobian.T))
    reading = reader.read(panda.home)
    assert reading.manipulability == pytest.approx(wanted, rel=1e-9)
    assert reading.share == pytest.approx(wanted / reader.largest, rel=1e-9)
    assert 0.1 < reading.share <= 1.0


def test_a_stretched_arm_is_singular():
    arm = ikgym.arms.get("planar2")
    reader = Reader(arm, ikgym.tasks.get("position"))
    assert reader.read(np.array([0.3, 0.0])).share == pytest.approx(0.0, abs=1e-12)
    assert reader.read(np.array([0.3, np.pi / 2.0])).share == pytest.approx(1.0, abs=1e-3)


def test_joints_are_coloured_by_their_limits(panda, reader):
    q = panda.home.copy()
    q[1], q[3] = panda.upper[1], panda.lower[3] + 0.05
    reading = reader.read(q)
    assert reading.colours == (FREE, AT, FREE, NEAR, FREE, FREE, FREE)
    np.testing.assert_allclose(reading.margins[[1, 3]], [0.0, 0.05], atol=1e-12)


def test_sliders_go_as_far_as_the_limits(panda):
    low, high = slider_range(panda)
    np.testing.assert_array_equal([low, high], [panda.lower, panda.upper])
    arm = ikgym.arms.get("varga7")
    low, high = slider_range(arm)
    slide = np.array(arm.prismatic)
    np.testing.assert_array_equal(high[~slide], np.pi)
    np.testing.assert_allclose(high[slide], 0.5 * arm.reach(np.zeros(7)))
    np.testing.assert_array_equal(low, -high)
