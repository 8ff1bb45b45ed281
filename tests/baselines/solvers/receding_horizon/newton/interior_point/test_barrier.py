"""The smooth stand-in for max(0, u): by its definition, by differences, and in the limit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from baselines.solvers.receding_horizon.newton.terms import primal_dual_curvature, smoothed, trusted

PLACES = pytest.mark.parametrize("u", [-30.0, -1.0, -1e-3, 0.0, 1e-3, 1.0, 30.0])


@PLACES
@pytest.mark.parametrize(("weight", "mu"), [(1.0, 0.1), (7.0, 0.3), (100.0, 2.0)])
def test_value_is_the_least_over_what_lies_above(u, weight, mu):
    def over(above):  # above the larger of 0 and u
        t = max(0.0, u) + above
        return weight * t - mu * math.log(weight * t / mu) - mu * math.log(weight * (t - u) / mu)

    best = minimize_scalar(lambda log: over(math.exp(log)), bounds=(-20.0, 5.0), method="bounded").fun
    assert smoothed(u, weight, mu).value == pytest.approx(best, rel=1e-6, abs=1e-6)


@PLACES
def test_derivatives_against_central_differences(u):
    weight, mu, h = 3.0, 0.2, 1e-5
    here, low, high = (smoothed(at, weight, mu) for at in (u, u - h, u + h))
    assert here.gradient == pytest.approx((high.value - low.value) / (2.0 * h), abs=1e-8)
    # With the multiplier that the barrier itself has, the primal-dual curvature is its second derivative.
    curvature = primal_dual_curvature(here, weight, here.gradient)
    assert curvature == pytest.approx((high.gradient - low.gradient) / (2.0 * h), rel=1e-5, abs=1e-9)


@PLACES
def test_it_tends_to_the_part_beyond_the_bound(u):
    here = smoothed(u, 5.0, 1e-12)
    assert here.value == pytest.approx(5.0 * max(u, 0.0), abs=1e-9)
    assert here.gradient == pytest.approx(5.0 * (u > 0.0) + 2.5 * (u == 0.0), abs=1e-8)


def test_far_from_the_bound_nothing_is_lost_to_rounding():
    """φ' = μ / |u| far inside, and w - μ / u far outside, to full precision."""
    inside, outside = smoothed(-1e6, 1e3, 1e-9), smoothed(1e6, 1e3, 1e-9)
    assert inside.gradient == pytest.approx(1e-15, rel=1e-12)
    assert outside.above / outside.room == pytest.approx(1e6 * 1e3 / 1e-9, rel=1e-12)


def test_a_multiplier_keeps_away_from_0_and_from_the_weight():
    here = smoothed(-1.0, 10.0, 1e-3)
    assert trusted(-5.0, here, 10.0) == pytest.approx(here.gradient / 1e4)
    assert trusted(20.0, here, 10.0) == pytest.approx(1e4 * here.gradient)
    assert trusted(2e-3, here, 10.0) == 2e-3
    near = smoothed(1.0, 10.0, 1e-3)
    assert np.isclose(10.0 - trusted(20.0, near, 10.0), (10.0 - near.gradient) / 1e4, rtol=1e-6)
