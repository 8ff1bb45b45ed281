"""The weighted pseudoinverse against NumPy and against its optimality."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from tests.baselines.solvers.quadratic_program.paths import circle
from tests.baselines.solvers.resolved_rate.inverting import invert
from tests.baselines.solvers.resolved_rate.test_base import jacobians
from tests.every_scenario import ONE_OF_EACH
from tests.limited import limited


def weighted(scenario, **parameters):
    return baselines.make("weighted_pseudoinverse", scenario, **parameters)


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_is_the_formula(name):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    weights = np.linspace(0.5, 4.0, scenario.joints)
    step, status = invert(weighted(scenario, weights=tuple(weights)), jacobian, shift)
    inverse = np.diag(1.0 / weights)
    for j, dx, dq, s in zip(jacobian, shift, step, status, strict=True):
        # The formula squares the condition number; what it is off by is bounded with it.
        small = np.linalg.svd(j / np.sqrt(weights), compute_uv=False)
        kept = small[small > 1e-12 * small[0]]
        wanted = inverse @ j.T @ np.linalg.pinv(j @ inverse @ j.T, rcond=1e-24 + (0.5 * kept[-1] / small[0]) ** 2) @ dx
        tolerance = 1e-13 * (small[0] / kept[-1]) ** 2
        if tolerance < 1e-3:
            np.testing.assert_allclose(dq, wanted, atol=tolerance * np.linalg.norm(wanted) + 1e-15)
        full = min(scenario.task.error_size, scenario.joints, 6)
        assert s == (Status.APPLIED if len(kept) == full else Status.RANK_DEFICIENT)


def test_minimises_the_weighted_squares_under_the_task():
    """By the optimality conditions: W Δq lies in the span of the rows of J."""
    scenario = ikgym.scenarios.get("varga7-fast")
    jacobian, shift = jacobians(scenario)
    weights = np.array([7.0, 1.0, 3.0, 0.1, 1.0, 2.0, 5.0])
    step, _ = invert(weighted(scenario, weights=list(weights)), jacobian, shift)
    for j, dx, dq in zip(jacobian[:-1], shift, step, strict=False):
        np.testing.assert_allclose(j @ dq, dx, atol=1e-9)
        null = np.linalg.svd(j)[2][-1]
        assert abs(null @ (weights * dq)) < 1e-9 * np.linalg.norm(weights * dq)


@pytest.mark.parametrize("one", [1.0, 3])
def test_equal_weights_are_moore_penrose(one):
    scenario = ikgym.scenarios.get("varga7-fast")
    jacobian, shift = jacobians(scenario)
    plain, _ = invert(baselines.make("moore_penrose", scenario), jacobian, shift)
    same, _ = invert(weighted(scenario, weights=one), jacobian, shift)
    np.testing.assert_allclose(same, plain, rtol=1e-9, atol=1e-15)


def test_a_heavy_joint_moves_little():
    scenario = ikgym.scenarios.get("varga7-fast")
    jacobian, shift = jacobians(scenario)
    jacobian, shift = jacobian[:-1], shift[:-1]
    weights = np.ones(7)
    weights[3] = 1e8
    plain, _ = invert(weighted(scenario), jacobian, shift)
    heavy, _ = invert(weighted(scenario, weights=tuple(weights)), jacobian, shift)
    assert (abs(heavy[:, 3]) < 1e-3 * abs(plain[:, 3])).all()


def test_by_default_joints_weigh_by_their_velocity_limits():
    free = ikgym.scenarios.get("varga7-fast")
    assert weighted(free).weights == 1.0
    panda = circle()
    limit = panda.arm.velocity_limit
    np.testing.assert_allclose(weighted(panda).weights, (limit.max() / limit) ** 2, rtol=1e-15)
    assert weighted(panda, weights=1.0).weights == 1.0
    # A joint without a limit is as fast as an action can make it.
    some = limited()
    np.testing.assert_allclose(weighted(some).weights, (20.0 / np.array([5, 20, 8, 20, 20, 10, 10])) ** 2, rtol=1e-15)
    equal = free.replace(arm=free.arm.replace(velocity_limit=np.full(7, 3.0)))
    assert weighted(equal).weights == (1.0,) * 7


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        (0.0, "weights: expected numbers above 0"),
        ((1, 1, 1, 1, 1, 1, -1), "weights: expected numbers above 0"),
        ((1.0, 2.0), r"weights: expected shape \(7,\), got \(2,\)"),
        (np.nan, "weights: expected finite numbers"),
        ("heavy", "weights: expected an array of real numbers"),
    ],
)
def test_bad_weights(weights, message):
    with pytest.raises(InvalidInputError, match=message):
        weighted("varga7-fast", weights=weights)
