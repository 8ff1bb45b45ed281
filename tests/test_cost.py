"""The tracking cost against the paper's formula, and its derivatives against central differences."""

import functools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ikgym import ProximityCost, TrackingCost
from ikgym.kernels import cost as cost_kernels

COSTS = [
    TrackingCost(),
    TrackingCost(delta_x=0.02, p_x=2.5, delta_qdot=0.3, p_out=6, p_in=2),
    TrackingCost(delta_x=1.0, p_x=1.0, delta_qdot=2.0, p_out=1.0, p_in=1.5),
]
numbers = st.floats(-50, 50, allow_nan=False)


def printed(values, delta, inside, outside):
    """Φ^X and Φ^U as they are printed (Varga 2021, section III)."""
    return sum(abs(x / delta) ** outside if abs(x / delta) > 1 else abs(x / delta) ** inside for x in values)


def derivative(cost, kind, values):
    """What a kernel says of errors or velocities, by the tail of its name: the gradient or the curvature."""
    out = np.empty(len(values))
    getattr(cost_kernels, kind)(cost.parameters, np.array(values, dtype=float), out)
    return out


@pytest.mark.parametrize("cost", COSTS)
@given(values=st.lists(numbers, min_size=1, max_size=7))
def test_value_is_the_printed_formula(cost, values):
    assert cost.tracking(values) == pytest.approx(printed(values, cost.delta_x, 2, cost.p_x), rel=1e-12)
    assert cost.velocity(values) == pytest.approx(printed(values, cost.delta_qdot, cost.p_in, cost.p_out), rel=1e-12)


def test_default_parameters_are_the_paper_s():
    cost = TrackingCost()
    assert (cost.delta_x, cost.p_x, cost.delta_qdot, cost.p_out, cost.p_in) == (1e-3, 3, 0.8, 4, 4)
    assert cost.tracking([1e-3, -2e-3, 5e-4, 0, 0, 0]) == pytest.approx(1 + 8 + 0.25)
    assert cost.velocity([0.8, -1.6, 0.4, 0, 0, 0, 0]) == pytest.approx(1 + 16 + 1 / 16)


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("kind", ["tracking", "velocity"])
def test_derivatives_against_central_differences(cost, kind):
    delta = cost.delta_x if kind == "tracking" else cost.delta_qdot
    value = getattr(cost, kind)
    gradient, curvature = (functools.partial(derivative, cost, kind + tail) for tail in ("_gradient", "_curvature"))
    step = 1e-5 * delta
    # Away from the kinks at 0 and at ±Δ; one component at a time, so that large ones do not drown small ones.
    for x in delta * np.array([-3.0, -1.2, -0.7, -0.1, 0.2, 0.9, 1.1, 2.0, 10.0]):
        up, down = [x + step], [x - step]
        assert gradient([x])[0] == pytest.approx((value(up) - value(down)) / (2 * step), rel=1e-6)
        assert curvature([x])[0] == pytest.approx(
            (gradient(up)[0] - gradient(down)[0]) / (2 * step), rel=1e-6, abs=1e-6 / delta**2
        )
    together = delta * np.array([-3.0, 0.2, 1.1])
    np.testing.assert_array_equal(gradient(together), [gradient([x])[0] for x in together])


def test_batches_and_compiled_against_plain_python():
    rng = np.random.default_rng(0)
    errors = rng.normal(0, 2e-3, (4, 5, 6))
    cost = TrackingCost()
    values = cost.tracking(errors)
    assert values.shape == (4, 5)
    for index in np.ndindex(4, 5):
        assert values[index] == cost.tracking(errors[index])
        assert values[index] == cost_kernels.tracking.py_func(cost.parameters, errors[index])


@pytest.mark.parametrize("near", [ProximityCost(0.05), ProximityCost(0.03, 0.07, 1.5, 4.0)])
@given(distance=st.floats(-0.02, 0.08))
def test_proximity_is_the_formula(near, distance):
    depth = near.clearance - max(distance, 0.0)
    expected = printed([depth], near.delta, near.p_in, near.p_out) if depth > 0.0 else 0.0
    assert near.value(distance) == pytest.approx(expected, rel=1e-12)
    assert near.value(distance) <= near.largest == near.value(0.0) == near.value(-1.0)
    np.testing.assert_array_equal(near.value([[distance, 9.0]]), [[near.value(distance), 0.0]])


# What the kernels gave under the present version.
ERROR = np.array([0.0005, -0.002, 0.03, 0.0, -0.5, 0.001])
QDOT = np.array([0.1, -0.5, 0.79, 0.0, -0.81, 2.0, -12.5])
GOLDEN = [(125027009.25, 59645.861982470706), (3127.7688009606313, 5232869419.544575)]


@pytest.mark.parametrize(("cost", "golden"), list(zip(COSTS, GOLDEN, strict=False)))
def test_values_belong_to_the_version(cost, golden):
    """Whoever changes a value raises `COST_VERSION`, and with it sets aside all that was measured under the old one."""
    assert cost_kernels.COST_VERSION == 1, "raise it together with new values here"
    assert (cost.tracking(ERROR), cost.velocity(QDOT)) == pytest.approx(golden, rel=1e-13)
