"""The truncated singular value decomposition against NumPy, its bound, and its status."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from tests.baselines.solvers.resolved_rate.inverting import invert
from tests.baselines.solvers.resolved_rate.test_base import jacobians
from tests.every_scenario import ONE_OF_EACH


@pytest.mark.parametrize("threshold", [1e-3, 0.03, 0.3])
@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_leaves_out_the_small_singular_values(name, threshold):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    step, status = invert(baselines.make("truncated_svd", scenario, threshold=threshold), jacobian, shift)
    full = min(scenario.task.error_size, scenario.joints, 6)
    for j, dx, dq, s in zip(jacobian, shift, step, status, strict=True):
        u, sigma, vt = np.linalg.svd(j, full_matrices=False)
        kept = sigma > threshold * sigma[0]
        wanted = vt[kept].T @ ((u[:, kept].T @ dx) / sigma[kept])
        np.testing.assert_allclose(dq, wanted, rtol=1e-8, atol=1e-12 * np.linalg.norm(wanted))
        assert np.linalg.norm(dq) <= np.linalg.norm(dx) / (threshold * sigma[0]) * (1 + 1e-12)
        assert s == (Status.APPLIED if kept.sum() == full else Status.RANK_DEFICIENT)


def test_both_statuses_occur():
    scenario = ikgym.scenarios.get("varga7-fast")
    _, status = invert(baselines.make("truncated_svd", scenario, threshold=0.02), *jacobians(scenario))
    assert set(status) == {Status.APPLIED, Status.RANK_DEFICIENT}


@pytest.mark.parametrize(
    ("threshold", "message"),
    [
        (-0.1, "threshold: expected a finite number of at least 0, got -0.1"),
        (1.0, "threshold: expected a number of at least 0 and below 1, got 1"),
        (np.inf, "threshold: expected a finite number"),
    ],
)
def test_bad_thresholds(threshold, message):
    with pytest.raises(InvalidInputError, match=message):
        baselines.make("truncated_svd", "varga7-fast", threshold=threshold)
