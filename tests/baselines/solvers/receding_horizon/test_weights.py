"""Weights of the joints: a heavy one does less, and only ratios count."""

import functools

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from ikgym.exceptions import InvalidInputError
from tests.comparison import identical

#: To the optimum, with a velocity cost that matters.
SHORT = {"horizon": 3}
DESCENT = SHORT | {"tolerance": 1e-4, "iterations": 3000, "alpha_min": 1e-4, "alpha_max": 5e-3, "gradient": "analytic"}
COST = ikgym.TrackingCost(delta_qdot=1.0, p_x=2.0, p_in=2.0, p_out=2.0)
FAMILY = {"rhc": SHORT, "rhc_foresight": {"horizon": 200}, "rhc_gradient": DESCENT, "rhc_lagrange": DESCENT}
HEAVY = (100.0, *[1.0] * 7)


@functools.cache
def played(name, weights):
    scenario = ikgym.scenarios.get("tiago-circle").replace(steps=200, cost=COST)
    return rollout(scenario, baselines.make(name, scenario, joint_weights=weights, **FAMILY[name]), 0)


@pytest.mark.parametrize("name", FAMILY)
def test_a_heavy_torso_is_spared(name):
    equal, heavy, alike = (played(name, weights) for weights in (1.0, HEAVY, (7.0,) * 8))
    assert np.ptp(heavy.q[:, 0]) < 0.3 * np.ptp(equal.q[:, 0])
    assert heavy.position_error.max() < 1e-4
    assert identical(alike.q, equal.q)


def test_descent_and_newton_agree():
    costs = [played(name, HEAVY).cost.sum() for name in ("rhc", "rhc_gradient", "rhc_lagrange")]
    np.testing.assert_allclose(costs[1:], costs[0], rtol=1e-3)


@pytest.mark.parametrize("name", FAMILY)
def test_bad_weights_are_refused(name):
    with pytest.raises(InvalidInputError, match="joint_weights: expected numbers above 0, got"):
        baselines.make(name, "tiago-circle", joint_weights=(1.0, *[0.0] * 7))
