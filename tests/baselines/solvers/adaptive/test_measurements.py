"""Which poses are new, and where the joints were when they were measured."""

from __future__ import annotations

import numpy as np

from baselines.policy import Batch
from baselines.solvers.adaptive.measurements import nothing_measured, recall


def played(ages, q_ages=None, steps=8):
    """The joint coordinate is the step; what is recalled of it, and whether the pose is new."""
    past, age = nothing_measured(1, steps, 1)
    new, then = [], []
    for k, pose_age in enumerate(ages):
        q_age = 0 if q_ages is None else q_ages[k]
        one = np.ones((1, 1))
        # The joint coordinates that are shown are late themselves.
        batch = Batch((k - q_age) * one, one, one, one[None], one, q_age * one, pose_age * one)
        measured = recall(batch, 1.0, past, age)
        past, age = measured.before, measured.age
        new.append(bool(measured.new[0]))
        then.append(float(measured.q[0, 0]))
    return new, then


def test_a_camera_that_is_slow_and_loses_a_picture():
    new, then = played([0, 1, 2, 0, 1, 2, 3, 4, 5, 0])
    assert new == [True, False, False, True, False, False, False, False, False, True]
    assert [t for n, t in zip(new, then, strict=True) if n] == [0.0, 3.0, 9.0]


def test_a_camera_that_is_late_at_each_step():
    new, then = played([0, 1, 2, 2, 2, 2])
    assert new == [True, False, False, True, True, True]
    assert [t for n, t in zip(new, then, strict=True) if n] == [0.0, 1.0, 2.0, 3.0]


def test_joint_coordinates_that_are_late_as_well():
    """Those of the moment of the pose are among the former ones; older ones are taken to have gone on."""
    _, then = played([3] * 8, [1] * 8)
    assert then[4:] == [1.0, 2.0, 3.0, 4.0]
    _, then = played([1] * 8, [3] * 8)
    assert then[4:] == [3.0, 4.0, 5.0, 6.0]


def test_what_is_older_than_the_history_is_not_used():
    new, _ = played([9, 9, 9], steps=8)
    assert new == [False] * 3
    new, _ = played([7, 7, 7], steps=8)
    assert new == [True] * 3


def test_observations_without_ages_are_new_at_each_step():
    batch = Batch(*[np.ones((1, 1))] * 3, np.ones((1, 1, 1)), np.ones((1, 1)))
    past, age = nothing_measured(1, 4, 1)
    for _ in range(3):
        measured = recall(batch, 1.0, past, age)
        past, age = measured.before, measured.age
        assert measured.new.all()
