"""A payload at some knots: it is what the kinematics see, and nothing else."""

import numpy as np
import pytest

from baselines.solvers.receding_horizon.newton.cost import linearise, merit, true_cost
from tests.baselines.solvers.receding_horizon.newton.problems import place
from tests.baselines.solvers.receding_horizon.newton.test_cost import differences

PAYLOAD = np.linspace(1e-3, 2e-3, 7)


def from_knot(first, knots=4):
    return np.where(np.arange(knots)[:, None] >= first, PAYLOAD, 0.0)


def test_a_payload_from_the_start_is_an_arm_that_stands_elsewhere():
    at = place("panda", "pose", limits=False)
    elsewhere = at.problem._replace(start=at.start + PAYLOAD)
    loaded = true_cost(at.problem._replace(load=from_knot(0)), at.path, at.workspace)
    assert loaded == pytest.approx(true_cost(elsewhere, at.path + PAYLOAD, at.workspace), rel=1e-9)
    assert loaded != pytest.approx(true_cost(at.problem, at.path, at.workspace), rel=1e-3)


def test_the_gradient_with_a_payload_on_the_way():
    at = place("panda", "pose", delta_x=1e-4)
    problem, workspace = at.problem._replace(load=from_knot(2)), at.workspace
    linearise(problem, at.path, at.multipliers, False, True, workspace)
    central = differences(lambda x: merit(problem, x, at.multipliers, workspace), at.path, 1e-8)
    got = workspace.model.gradient.ravel()
    np.testing.assert_allclose(got, central, atol=1e-4 * abs(central).max())
