"""The transposed Jacobian against its definition."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines.solvers.arm_size import error_weights, radian
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from tests.baselines.solvers.resolved_rate.inverting import invert
from tests.baselines.solvers.resolved_rate.test_base import jacobians
from tests.every_scenario import ONE_OF_EACH


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_is_the_best_step_along_the_gradient(name):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    policy = baselines.make("jacobian_transpose", scenario)
    step, status = invert(policy, jacobian, shift)
    assert (status == Status.APPLIED).all()
    w = np.sqrt(error_weights(scenario.task, policy.length))
    for j, dx, dq in zip(w[:, None] * jacobian, w * shift, step, strict=True):
        h = j.T @ dx
        alpha = (dx @ j @ j.T @ dx) / np.linalg.norm(j @ j.T @ dx) ** 2
        np.testing.assert_allclose(dq, alpha * h, rtol=1e-12, atol=1e-18)
        # The exact line search by least squares in one unknown.
        best = np.linalg.lstsq((j @ h)[:, None], dx, rcond=None)[0][0]
        np.testing.assert_allclose(dq, best * h, rtol=1e-10, atol=1e-17)
        assert np.linalg.norm(dx - j @ dq) <= np.linalg.norm(dx)


def test_with_a_length_of_1_m_nothing_is_weighed():
    """To the last bit, by the formula as it was before there were weights."""
    for name in ("varga7-fast", "khan8-q1", "zhang6-lspb", "faitli3-regular"):
        scenario = ikgym.scenarios.get(name)
        jacobian, shift = jacobians(scenario)
        step, _ = invert(baselines.make("jacobian_transpose", scenario, length=1.0), jacobian, shift)
        np.testing.assert_array_equal(step, [unweighed(j, dx) for j, dx in zip(jacobian, shift, strict=True)])


def unweighed(j, dx):
    squared = length = 0.0
    dq = np.zeros(j.shape[1])
    for k in range(len(dq)):
        for a in range(len(dx)):
            dq[k] += j[a, k] * dx[a]
        squared += dq[k] * dq[k]
    for a in range(len(dx)):
        made = 0.0
        for k in range(len(dq)):
            made += j[a, k] * dq[k]
        length += made * made
    return squared / length * dq


def test_is_exact_where_singular_values_are_equal():
    policy = baselines.make("jacobian_transpose", "faitli3-regular")
    j = 3.0 * np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    dx = np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(invert(policy, j[None], dx[None])[0][0], np.linalg.solve(j, dx), rtol=1e-12)


def test_stands_still_and_says_so_where_nothing_pulls():
    policy = baselines.make("jacobian_transpose", "faitli3-regular")
    jacobian = np.zeros((3, 3, 3))
    jacobian[:, :2] = np.eye(3)[:2]
    shift = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    step, status = invert(policy, jacobian, shift)
    np.testing.assert_array_equal(step, [[0, 0, 0], [0, 0, 0], [1, 0, 0]])
    assert status.tolist() == [Status.RANK_DEFICIENT, Status.APPLIED, Status.APPLIED]


def test_a_best_fit_of_redundant_coordinates_has_lost_no_rank():
    policy = baselines.make("jacobian_transpose", "khan8-q1", length=1.0)
    jacobian = np.random.default_rng(0).normal(size=(1, 12, 8))
    across = np.linalg.svd(jacobian[0])[0][:, -1:].T
    step, status = invert(policy, jacobian, across)
    np.testing.assert_array_equal(step, 0.0)
    assert status[0] == Status.APPLIED


def test_the_length_is_the_models():
    policy = baselines.make("jacobian_transpose", "varga7-fast")
    assert policy.parameters["length"] == policy.length == radian(policy.problem.model)


def test_bad_parameters():
    with pytest.raises(InvalidInputError, match="rank_tolerance: expected a finite number of at least 0, got -1"):
        baselines.make("jacobian_transpose", "varga7-fast", rank_tolerance=-1.0)
    with pytest.raises(InvalidInputError, match="length: expected a finite number above 0, got 0"):
        baselines.make("jacobian_transpose", "varga7-fast", length=0.0)
    with pytest.raises(InvalidInputError, match="gain: expected"):
        baselines.make("jacobian_transpose", "varga7-fast", gain=0.0)
