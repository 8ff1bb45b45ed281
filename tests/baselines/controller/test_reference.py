"""Rotations and positions of a reference are converted once each, and never mistaken for others."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines.controller import reference
from baselines.controller.reference import Window
from ikgym.exceptions import InvalidInputError

LENGTH = 5


@pytest.fixture
def counted(monkeypatch):
    """How many poses were converted in each call."""
    calls, real = [], reference.convert
    monkeypatch.setattr(reference, "convert", lambda *given: (calls.append(len(given[1])), real(*given)))
    return calls


def poses(number):
    arm = ikgym.arms.get("panda")
    return arm.forward(np.random.default_rng(2).uniform(-1.0, 1.0, (number, 7)))


@pytest.mark.parametrize("length", [1, LENGTH])
@pytest.mark.parametrize("name", ikgym.tasks.names())
def test_only_the_new_pose_is_converted(name, length, counted):
    task, (rotations, positions) = ikgym.tasks.get(name), poses(40)
    window, expected = Window(task), task.coordinates(rotations, positions)
    for k in range(40 - length):
        here = slice(k, k + length)
        np.testing.assert_array_equal(window.ahead((rotations[here], positions[here])), expected[here])
    assert counted == [length] + [1] * (39 - length)


def test_the_newest_pose_comes_alone(counted):
    task, (rotations, positions) = ikgym.tasks.get("pose"), poses(20)
    window, expected = Window(task), task.coordinates(rotations, positions)
    window.ahead((rotations[:LENGTH], positions[:LENGTH]))
    for k in range(LENGTH, 20):
        given = rotations[k], positions[k]
        np.testing.assert_array_equal(window.ahead(given), expected[k + 1 - LENGTH : k + 1])
    assert counted == [LENGTH] + [1] * (20 - LENGTH)
    window.clear()
    np.testing.assert_array_equal(window.ahead((rotations[3], positions[3])), expected[3:4])


def test_other_poses_are_all_converted(counted):
    task, (rotations, positions) = ikgym.tasks.get("pose"), poses(12)
    window = Window(task)
    for first, change in ((0, 0.0), (1, 0.0), (1, 0.0), (2, 1e-9), (7, 0.0)):
        given = rotations[first : first + LENGTH].copy(), positions[first : first + LENGTH].copy()
        given[1][2] += change
        np.testing.assert_array_equal(window.ahead(given), task.coordinates(*given))
    assert counted == [LENGTH, 1, LENGTH, LENGTH]  # the same poses again are not converted
    np.testing.assert_array_equal(window.ahead((rotations, positions)), task.coordinates(rotations, positions))


def test_poses_that_are_no_numbers_stay_so():
    task, (rotations, positions) = ikgym.tasks.get("pose"), poses(LENGTH)
    rotations[:-1], positions[:-1] = np.nan, np.nan
    assert np.isnan(Window(task).ahead((rotations, positions))[:-1]).all()


def test_changes_of_the_caller_are_seen():
    """Also where the arrays are the same ones."""
    task, (rotations, positions) = ikgym.tasks.get("pose"), poses(LENGTH)
    window = Window(task)
    window.ahead((rotations, positions))
    positions[3] += 0.1
    np.testing.assert_array_equal(window.ahead((rotations, positions)), task.coordinates(rotations, positions))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((np.zeros((2, 3, 2)), np.zeros((2, 3))), r"reference: expected shape \(any, 3, 3\), got \(2, 3, 2\)"),
        ((np.zeros((2, 3, 3)), np.zeros((3, 3))), r"reference: expected shape \(2, 3\), got \(3, 3\)"),
        ((np.zeros((3, 3)), np.zeros(2)), r"reference: expected shape \(3,\), got \(2,\)"),
        (np.zeros((2, 6)), r"reference: expected shape \(any, 12\), got \(2, 6\)"),
    ],
)
def test_wrong_shapes(given, message):
    with pytest.raises(InvalidInputError, match=message):
        Window(ikgym.tasks.get("pose")).ahead(given)
