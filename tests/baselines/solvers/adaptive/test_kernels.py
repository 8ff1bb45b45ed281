"""Deviations of a pose, chains with parameters, and which poses are new."""

import numpy as np
import pytest

import ikgym
from baselines.policy import Batch
from baselines.solvers.adaptive.chain_parameters import changed_chain, parameter_twists
from baselines.solvers.adaptive.corrected import nothing_measured, recall
from baselines.solvers.adaptive.deviation import add_deviation, deviation_between, missing_deviation, move_deviation
from ikgym.kernels.kinematics import forward
from ikgym.kernels.rotations import rodrigues, rotation_vector

STEP = 1e-6


def changed(arm, parameters):
    n = arm.joints
    return changed_chain(arm.chain, parameters, np.empty((n, 3)), np.empty((n, 3)), np.empty(3))


def pose(arm, parameters, q):
    rotation, position = np.empty((3, 3)), np.empty(3)
    forward(changed(arm, parameters), q + parameters[: arm.joints], rotation, position)
    return rotation, position


@pytest.mark.parametrize("name", ["panda", "tiago"])
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


TASKS = ikgym.tasks.names()


def rotation(rng, size):
    vector = rng.standard_normal(3)
    return rodrigues(vector / np.linalg.norm(vector), size)


def two_poses(seed, size=0.02):
    """A pose of a model, and one that is a little off."""
    rng = np.random.default_rng(seed)
    modelled, off = rotation(rng, 1.0), rotation(rng, size)
    position, shift = rng.standard_normal(3), size * rng.standard_normal(3)
    return (modelled, position), (off @ modelled, position + shift)


@pytest.mark.parametrize("name", TASKS)
def test_a_deviation_leads_from_the_model_to_the_arm_and_back(name):
    task = ikgym.tasks.get(name)
    modelled, actual = two_poses(1)
    deviation = np.empty(6)
    deviation_between(task.kind, *actual, *modelled, deviation)
    ours, theirs = task.coordinates(*modelled)[None], task.coordinates(*actual)[None]
    moved = np.empty_like(ours)
    add_deviation(task.kind, deviation, 1.0, ours, moved)
    np.testing.assert_allclose(moved, theirs, atol=1e-14)
    add_deviation(task.kind, deviation, -1.0, theirs, moved)
    np.testing.assert_allclose(moved, ours, atol=1e-14)
    assert np.abs(ours - theirs).max() > 1e-3


@pytest.mark.parametrize("name", TASKS)
def test_what_is_missing_is_made_up_for(name):
    task = ikgym.tasks.get(name)
    modelled, actual = two_poses(2, size=0.3)
    ours, theirs = task.coordinates(*modelled), task.coordinates(*actual)
    deviation, missing, moved = np.full(6, 0.05), np.empty(6), np.empty((1, task.size))
    if name == "position":
        deviation[3:] = 0.0
    missing_deviation(task.kind, theirs, ours, deviation, missing)
    move_deviation(task.kind, missing, deviation)
    add_deviation(task.kind, deviation, 1.0, ours[None], moved)
    np.testing.assert_allclose(moved[0], theirs, atol=1e-13)
    # A share leads a share of the way, on the rotation group.
    deviation = np.zeros(6)
    missing_deviation(task.kind, theirs, ours, deviation, missing)
    move_deviation(task.kind, 0.25 * missing, deviation)
    left = np.empty(6)
    missing_deviation(task.kind, theirs, ours, deviation, left)
    np.testing.assert_allclose(np.linalg.norm(left), 0.75 * np.linalg.norm(missing), rtol=1e-12)


def played(pose_ages, q_age=0, steps=8):
    """The joint coordinate is the step; where it is recalled at each step, and at the steps with a new pose."""
    past, age = nothing_measured(1, steps, 1)
    then, new = [], []
    for k, pose_age in enumerate(pose_ages):
        one = np.ones((1, 1))
        # The joint coordinates that are shown are late themselves.
        batch = Batch((k - q_age) * one, one, one, one[None], one, q_age * one, pose_age * one)
        measured = recall(batch, 1.0, past, age)
        past, age = measured.before, measured.age
        then.append(float(measured.q[0, 0]))
        new += then[-1:] if measured.new[0] else []
    return then, new


def test_poses_are_taken_in_once_with_the_joint_coordinates_of_their_moment():
    slow_with_a_lost_picture, late_at_each_step = [0, 1, 2, 0, 1, 2, 3, 4, 5, 0], [0, 1, 2, 2, 2, 2]
    assert played(slow_with_a_lost_picture)[1] == [0.0, 3.0, 9.0]
    assert played(late_at_each_step)[1] == [0.0, 1.0, 2.0, 3.0]
    # What is older than the history is not used.
    assert len(played([9, 9, 9])[1]) == 0
    assert len(played([7, 7, 7])[1]) == 3
    # Joint coordinates that are late as well: those of the moment of the pose are among the former ones; older ones
    # are taken to have gone on.
    assert played([3] * 8, 1)[0][4:] == [1.0, 2.0, 3.0, 4.0]
    assert played([1] * 8, 3)[0][4:] == [3.0, 4.0, 5.0, 6.0]
