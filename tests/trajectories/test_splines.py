"""Cubic splines against SciPy's, and lengths of curves."""

import numpy as np
import pytest
from scipy import interpolate

from ikgym.trajectories.splines import ArcLength, CubicSpline

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("at_rest", [False, True])
@pytest.mark.parametrize("count", [2, 3, 9])
def test_splines_are_those_of_scipy(count, at_rest):
    knots, values = np.cumsum(RNG.uniform(0.1, 2.0, count)), RNG.normal(size=(count, 4))
    wanted = interpolate.CubicSpline(knots, values, bc_type="clamped" if at_rest else "natural")
    got, at = CubicSpline.through(knots, values, at_rest=at_rest), np.linspace(knots[0], knots[-1], 101)
    for derivative, tolerance in ((0, 1e-13), (1, 1e-12), (2, 1e-11)):
        scale = 1.0 + np.abs(wanted(at, derivative)).max()
        np.testing.assert_allclose(got(at, derivative), wanted(at, derivative), atol=tolerance * scale)
    np.testing.assert_allclose(got(np.array([-9.0, 99.0])), values[[0, -1]], atol=1e-13)


def test_the_length_of_a_parabola():
    """y = x²: s = x √(1 + 4 x²) / 2 + asinh(2 x) / 4."""
    arc = ArcLength(lambda x: np.sqrt(1.0 + 4.0 * x**2), np.linspace(0.0, 3.0, 25))
    x = np.sort(RNG.uniform(0.0, 3.0, 50))
    s = 0.5 * x * np.sqrt(1.0 + 4.0 * x**2) + 0.25 * np.arcsinh(2.0 * x)
    np.testing.assert_allclose(arc.parameter(s), x, atol=1e-12)
    assert arc.lengths[-1] == pytest.approx(1.5 * 37**0.5 + 0.25 * np.arcsinh(6.0), rel=1e-14)
    np.testing.assert_allclose(arc.parameter(np.array([0.0, arc.lengths[-1]])), [0.0, 3.0], atol=1e-14)
