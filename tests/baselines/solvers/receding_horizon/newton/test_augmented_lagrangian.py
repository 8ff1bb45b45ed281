"""Kinks and limits held by multipliers: smooth, convex, from below, and exact in the end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.solvers.receding_horizon.newton.terms import augmented_term
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


@pytest.mark.parametrize("x", [-3.0, -0.71, -0.3, 0.0, 0.9, 1.21, 2.0])
@pytest.mark.parametrize("largest", [1.0, np.inf])
@pytest.mark.parametrize("multiplier", [-0.9, 0.0, 0.4, 1.0])
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


@given(xs, xs, terms, st.floats(0.0, 1.0))
def test_is_convex(a, b, term, share):
    at = term_at(share * a + (1 - share) * b, *term)[0]
    between = share * term_at(a, *term)[0] + (1 - share) * term_at(b, *term)[0]
    assert at <= between + 1e-9 * (1.0 + abs(between))


@given(xs, kinks)
def test_a_kink_is_touched_from_below(x, term):
    beyond = max(x - HIGH, LOW - x, 0.0)
    value, slope, _, _ = term_at(x, *term)
    assert value <= beyond + 1e-12
    # With the multiplier that it answers, again and again, it comes to the kink itself.
    for _ in range(2000):
        slope = term_at(x, slope, *term[1:])[1]
    far = min(abs(x - HIGH), abs(x - LOW))
    if far > 0.02:
        assert term_at(x, slope, *term[1:])[0] == pytest.approx(beyond, abs=1e-9)


@given(st.floats(LOW, HIGH), terms)
def test_inside_the_bounds_the_term_vanishes_with_no_multiplier(x, term):
    assert term_at(x, 0.0, *term[1:]) == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("largest", [1.0, np.inf])
@pytest.mark.parametrize(("goal", "wanted"), [(1.6, 0.4), (-1.0, -0.3)])
def test_multipliers_converge_to_the_minimum_on_the_bound(goal, wanted, largest):
    """½ (x - goal)² with a bound at 1.2 and -0.7: the minimum lies on it, and λ is the slope that it takes up."""
    multiplier = 0.0
    for _ in range(30):
        low, high = -3.0, 3.0
        for _ in range(60):
            x = 0.5 * (low + high)
            low, high = (low, x) if x - goal + term_at(x, multiplier, 5.0, largest)[1] > 0.0 else (x, high)
        multiplier = term_at(x, multiplier, 5.0, largest)[1]
    assert x == pytest.approx(HIGH if goal > 0.0 else LOW, abs=1e-12)
    assert multiplier == pytest.approx(wanted, abs=1e-12)
