"""The smooth terms of kinks and limits: by their definitions, and their derivatives by differences."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from baselines.solvers.receding_horizon.newton.terms import augmented_term, primal_dual_curvature, smooth
from ikgym.kernels.jit import kernel

LOW, HIGH = -0.7, 1.2


@kernel
def term_at(x, multiplier, penalty, largest):
    return augmented_term(x, LOW, HIGH, multiplier, penalty, largest)


xs = st.floats(-4.0, 4.0)
kinks = st.tuples(st.floats(-1.0, 1.0), st.floats(0.1, 100.0), st.just(1.0))
limits = st.tuples(st.floats(-50.0, 50.0), st.floats(0.1, 100.0), st.just(np.inf))
terms = st.one_of(kinks, limits)


def by_search(x, multiplier, penalty, largest):
    """The definition: the largest of λ (x - bound) - (λ - λ₀)² / (2 ρ), λ searched on either side."""
    span = min(largest, 2000.0)
    best = -np.inf
    for bound, sides in ((HIGH, np.linspace(0.0, span, 400_001)), (LOW, np.linspace(-span, 0.0, 400_001))):
        values = sides * (x - bound) - (sides - multiplier) ** 2 / (2.0 * penalty)
        best = max(best, values.max())
    return best


@pytest.mark.parametrize("x", [-3.0, -0.71, 0.0, 1.21, 2.0])
@pytest.mark.parametrize("largest", [1.0, np.inf])
@pytest.mark.parametrize("multiplier", [-0.9, 0.4])
def test_is_the_largest_over_the_multiplier(x, largest, multiplier):
    assert term_at(x, multiplier, 10.0, largest)[0] == pytest.approx(by_search(x, multiplier, 10.0, largest), abs=1e-5)


@given(xs, terms)
def test_slope_and_curvature_are_derivatives(x, term):
    step = 1e-5
    value, slope, curvature, linear = term_at(x, *term)
    (up, above, _, _), (down, below, _, _) = term_at(x + step, *term), term_at(x - step, *term)
    # Smooth: also where one formula goes over into another, the slope differs by no more than ρ times the step.
    size = 1.0 + abs(value) + abs(slope)
    assert slope == pytest.approx((up - down) / (2 * step), abs=1.1 * term[1] * step + 1e-8 * size / step * 1e-3)
    assert -1e-9 <= above - below <= 2 * step * term[1] * 1.001 + 1e-9 * size
    ahead, behind = (above - slope) / step, (slope - below) / step
    # On the seam of two formulas the curvature is that of either side.
    assert min(abs(curvature - ahead), abs(curvature - behind)) <= 1e-4 * term[1] + 1e-14 * size / step
    assert curvature in (0.0, term[1])
    assert abs(slope) <= term[2]
    bound = HIGH if slope > 0.0 else LOW
    assert linear == pytest.approx(slope * (x - bound) if slope else 0.0, abs=1e-12 * size)


PLACES = pytest.mark.parametrize("u", [-30.0, -1.0, -1e-3, 0.0, 1e-3, 1.0, 30.0])


@PLACES
@pytest.mark.parametrize(("weight", "mu"), [(1.0, 0.1), (7.0, 0.3), (100.0, 2.0)])
def test_value_is_the_least_over_what_lies_above(u, weight, mu):
    def over(above):  # above the larger of 0 and u
        t = max(0.0, u) + above
        return weight * t - mu * math.log(weight * t / mu) - mu * math.log(weight * (t - u) / mu)

    best = minimize_scalar(lambda log: over(math.exp(log)), bounds=(-20.0, 5.0), method="bounded").fun
    assert smooth(u, weight, mu).value == pytest.approx(best, rel=1e-6, abs=1e-6)


@PLACES
def test_derivatives_against_central_differences(u):
    weight, mu, h = 3.0, 0.2, 1e-5
    here, low, high = (smooth(at, weight, mu) for at in (u, u - h, u + h))
    assert here.gradient == pytest.approx((high.value - low.value) / (2.0 * h), abs=1e-8)
    # With the multiplier that the barrier itself has, the primal-dual curvature is its second derivative.
    curvature = primal_dual_curvature(here, weight, here.gradient)
    assert curvature == pytest.approx((high.gradient - low.gradient) / (2.0 * h), rel=1e-5, abs=1e-9)
