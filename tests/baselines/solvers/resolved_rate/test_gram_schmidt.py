"""The Gram–Schmidt reconstruction: Moore–Penrose at full rank, exact in the rows that it keeps."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines.solvers.resolved_rate.gram_schmidt import GramSchmidt
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from tests.baselines.solvers.resolved_rate.inverting import invert
from tests.baselines.solvers.resolved_rate.test_base import jacobians
from tests.every_scenario import ONE_OF_EACH


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_full_rank_without_truncation_is_moore_penrose(name):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    rng = np.random.default_rng(1)
    if scenario.task.name == "matrix":
        # Redundant coordinates: of a demand that the arm cannot meet the two make different things.
        shift = np.einsum("ben,bn->be", jacobian, rng.normal(size=(len(jacobian), scenario.joints)) * 1e-3)
    step, status = invert(baselines.make("gram_schmidt", scenario, truncation=0.0), jacobian, shift)
    full, compared = min(scenario.task.error_size, scenario.joints, 6), 0
    for j, dx, dq, s in zip(jacobian, shift, step, status, strict=True):
        sigma = np.linalg.svd(j, compute_uv=False)
        if sigma[full - 1] < 1e-6 * sigma[0]:
            continue
        wanted = np.linalg.pinv(j, rcond=1e-10) @ dx
        tolerance = 1e-13 * sigma[0] / sigma[full - 1]
        np.testing.assert_allclose(dq, wanted, atol=tolerance * np.linalg.norm(wanted))
        assert s == Status.APPLIED
        compared += 1
    assert compared >= 20 or "literal" in name


def test_makes_the_shift_where_rows_are_nearly_parallel():
    """To rounding of the large step that this takes; taken off once only, rows would miss by ten million times that."""
    policy = baselines.make("gram_schmidt", "varga7-fast", truncation=0.0)
    rng = np.random.default_rng(3)
    for _ in range(5):
        j, dx = rng.normal(size=7) + 1e-7 * rng.normal(size=(6, 7)), rng.normal(size=6)
        step, _ = invert(policy, j[None], dx[None])
        np.testing.assert_allclose(j @ step[0], dx, atol=1e-15 * np.linalg.norm(j, 2) * np.linalg.norm(step))


def rank_two():
    return np.array([[2.0, 0, 0], [0, 3, 0], [2, 3, 1e-5]])


def test_rows_left_out_are_not_tracked_and_the_others_are():
    policy = baselines.make("gram_schmidt", "faitli3-regular", truncation=1e-3)
    dx = np.array([1.0, 2.0, 30.0])
    step, status = invert(policy, rank_two()[None], dx[None])
    assert status[0] == Status.RANK_DEFICIENT
    # The longest row is the third, then the second of what remains; the first is left out.
    made = rank_two() @ step[0]
    np.testing.assert_allclose(made[1:], dx[1:], rtol=1e-12)
    assert abs(made[0] - dx[0]) > 1
    exact, status = invert(
        baselines.make("gram_schmidt", "faitli3-regular", truncation=1e-7), rank_two()[None], dx[None]
    )
    assert status[0] == Status.APPLIED
    np.testing.assert_allclose(rank_two() @ exact[0], dx, rtol=1e-9)


def test_no_jacobian_at_all():
    step, status = invert(baselines.make("gram_schmidt", "faitli3-regular"), np.zeros((1, 3, 3)), np.ones((1, 3)))
    np.testing.assert_array_equal(step, 0.0)
    assert status[0] == Status.RANK_DEFICIENT


def test_is_labelled():
    assert "RECONSTRUCTION" in GramSchmidt.__doc__


@pytest.mark.parametrize("truncation", [-1e-3, 1.0, np.nan])
def test_bad_truncations(truncation):
    with pytest.raises(InvalidInputError, match="truncation: expected"):
        baselines.make("gram_schmidt", "varga7-fast", truncation=truncation)
