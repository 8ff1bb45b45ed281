"""The rules for λ against values worked out by hand, and the words for wrong numbers."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.solvers.levenberg_marquardt.damping import (
    LARGEST,
    RULES,
    damping_next,
    damping_now,
    typical_link,
)


def law(rule, **numbers):
    return baselines.make("mfac", "zhang3-helix", rule=rule, **numbers).law


def now(rule, error=1.0, condition=1.0, stepped=np.nan, **numbers):
    return damping_now(law(rule, **numbers), error, condition, stepped)


def test_a_bound_belongs_to_the_interval_behind_it():
    """(37), and Table I: rows by the error, columns by the condition."""
    numbers = {"condition_bounds": (10, 100), "dampings": (0, 0.1, 0.5)}
    assert [now("condition", condition=at, **numbers) for at in (9.9, 10.0, 99.0, np.inf)] == [0.0, 0.1, 0.1, 0.5]
    numbers = {"error_bounds": (1.0,), "condition_bounds": (10.0,), "dampings": ((0, 1), (2, 3))}
    assert [now("table", *at, **numbers) for at in ((0.5, 5), (0.5, 10), (1.0, 5), (1e9, 1e9))] == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("restart", "error", "before", "wanted"),
    [
        (False, 11.0, 9.0, 2.2),
        (False, 10.0, 20.0, 1.6),
        (True, 11.0, 9.0, 7.0),
        (True, 11.0, 12.0, 2.2),
        (True, 11.0, np.inf, 2.2),
        (True, 9.0, 12.0, 1.6),
    ],
)
def test_threshold(restart, error, before, wanted):
    """(18) with a₁ = 1.1, a₂ = 1.25, t₁ = 10 and λ = 2; Remark 2 begins anew at λ₀ = 7 where t₁ is crossed upwards."""
    rule = law("threshold", damping=7.0, growth=1.1, decay=1.25, threshold=10.0, restart=restart)
    assert damping_next(rule, 2.0, error, before) == pytest.approx(wanted, rel=1e-15)


@pytest.mark.parametrize("rule", RULES)
def test_only_stepped_rules_step_and_none_leaves_the_numbers(rule):
    made = law(rule)
    after = damping_next(made, 2.0, 5.0, 4.0)
    assert (after != 2.0) == (rule in ("error_ratio", "threshold"))
    assert damping_next(made, damping_now(made, 1e160, np.inf, LARGEST), 1e160, 1e159) <= LARGEST


def test_defaults_scale_with_the_length_of_a_link():
    assert typical_link(ikgym.arms.get("zhang3")) == pytest.approx((5 + 7 + 7) / 3)
    assert typical_link(ikgym.Arm("point", np.zeros((1, 3)), np.array([[0, 0, 1.0]]))) == 1.0
    length = 19 / 3
    made = baselines.make("mfac", "zhang3-helix", rule="table")
    assert made.error_bounds == pytest.approx((1e-3 * length, 1e-1 * length))
    assert made.condition_bounds == (1e2, 1e4)
    assert made.dampings[2][2] == pytest.approx(0.1 * length**2)
    made = baselines.make("mfac", "zhang3-helix", rule="threshold")
    assert (made.damping, made.threshold) == pytest.approx((1e-3 * length**2, 0.1 * length))
