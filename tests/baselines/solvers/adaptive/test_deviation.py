"""Deviations from a model's pose: added, taken away, measured, in all task coordinates."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines.solvers.adaptive.deviation import add_deviation, deviation_between, missing_deviation, move_deviation
from ikgym.kernels.rotations import rodrigues

TASKS = ikgym.tasks.names()


def rotation(rng, size):
    vector = rng.standard_normal(3)
    return rodrigues(vector / np.linalg.norm(vector), size)


def poses(seed, size=0.02):
    """A pose of a model, and one that is a little off."""
    rng = np.random.default_rng(seed)
    modelled, off = rotation(rng, 1.0), rotation(rng, size)
    position, shift = rng.standard_normal(3), size * rng.standard_normal(3)
    return (modelled, position), (off @ modelled, position + shift)


@pytest.mark.parametrize("name", TASKS)
def test_a_deviation_leads_from_the_model_to_the_arm_and_back(name):
    task = ikgym.tasks.get(name)
    modelled, actual = poses(1)
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
    modelled, actual = poses(2, size=0.3)
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
