"""The transposed Jacobian against its definition."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from tests.baselines.solvers.resolved_rate.test_base import jacobians


@pytest.mark.parametrize("name", ikgym.scenarios.names())
def test_is_the_best_step_along_the_gradient(name):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    step, status = baselines.make("jacobian_transpose", scenario).invert(jacobian, shift)
    assert (status == Status.APPLIED).all()
    for j, dx, dq in zip(jacobian, shift, step, strict=True):
        h = j.T @ dx
        alpha = (dx @ j @ j.T @ dx) / np.linalg.norm(j @ j.T @ dx) ** 2
        np.testing.assert_allclose(dq, alpha * h, rtol=1e-12, atol=1e-18)
        # The exact line search by least squares in one unknown.
        best = np.linalg.lstsq((j @ h)[:, None], dx, rcond=None)[0][0]
        np.testing.assert_allclose(dq, best * h, rtol=1e-10, atol=1e-17)
        assert np.linalg.norm(dx - j @ dq) <= np.linalg.norm(dx)


def test_is_exact_where_singular_values_are_equal():
    policy = baselines.make("jacobian_transpose", "faitli3-regular")
    j = 3.0 * np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    dx = np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(policy.invert(j[None], dx[None])[0][0], np.linalg.solve(j, dx), rtol=1e-12)


def test_stands_still_and_says_so_where_nothing_pulls():
    policy = baselines.make("jacobian_transpose", "faitli3-regular")
    jacobian = np.zeros((3, 3, 3))
    jacobian[:, :2] = np.eye(3)[:2]
    shift = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    step, status = policy.invert(jacobian, shift)
    np.testing.assert_array_equal(step, [[0, 0, 0], [0, 0, 0], [1, 0, 0]])
    assert status.tolist() == [Status.RANK_DEFICIENT, Status.APPLIED, Status.APPLIED]


def test_a_best_fit_of_redundant_coordinates_has_lost_no_rank():
    policy = baselines.make("jacobian_transpose", "khan8-q1")
    jacobian = np.random.default_rng(0).normal(size=(1, 12, 8))
    across = np.linalg.svd(jacobian[0])[0][:, -1:].T
    step, status = policy.invert(jacobian, across)
    np.testing.assert_array_equal(step, 0.0)
    assert status[0] == Status.APPLIED


def test_nothing_is_inverted():
    assert baselines.make("jacobian_transpose", "varga7-fast").count(np.ones(1)) == (0, 1, 0, 1)


def test_bad_parameters():
    with pytest.raises(InvalidInputError, match="rank_tolerance: expected a finite number of at least 0, got -1"):
        baselines.make("jacobian_transpose", "varga7-fast", rank_tolerance=-1.0)
    with pytest.raises(InvalidInputError, match="gain: expected"):
        baselines.make("jacobian_transpose", "varga7-fast", gain=0.0)
