"""Rotations and positions of a reference are converted to task coordinates."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines.controller.reference import coordinates, coordinates_ahead
from ikgym.exceptions import InvalidInputError


@pytest.mark.parametrize("length", [1, 5])
@pytest.mark.parametrize("name", ikgym.tasks.names())
def test_poses_are_converted(name, length):
    task, arm = ikgym.tasks.get(name), ikgym.arms.get("panda")
    rotations, positions = arm.forward(np.random.default_rng(2).uniform(-1.0, 1.0, (length, 7)))
    expected = task.coordinates(rotations, positions)
    np.testing.assert_array_equal(coordinates_ahead(task, (rotations, positions)), expected)
    np.testing.assert_array_equal(coordinates_ahead(task, expected), expected)
    np.testing.assert_array_equal(coordinates("pose", task, (rotations[0], positions[0])), expected[0])
    rotations[0] = np.nan  # which the guards refuse
    assert np.isnan(coordinates_ahead(task, (rotations, positions))[0]).any() == task.has_orientation


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((np.zeros((2, 3, 2)), np.zeros((2, 3))), r"reference: expected shape \(any, 3, 3\), got \(2, 3, 2\)"),
        ((np.zeros((2, 3, 3)), np.zeros((3, 3))), r"reference: expected shape \(2, 3\), got \(3, 3\)"),
        ((np.zeros((3, 3)), np.zeros(3)), r"reference: expected shape \(any, 3, 3\), got \(3, 3\)"),
        (np.zeros((2, 6)), r"reference: expected shape \(any, 12\), got \(2, 6\)"),
    ],
)
def test_wrong_shapes(given, message):
    with pytest.raises(InvalidInputError, match=message):
        coordinates_ahead(ikgym.tasks.get("pose"), given)
