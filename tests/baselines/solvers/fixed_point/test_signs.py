"""The fixed-point transformation without a Jacobian on an arm with 2 joints: σ, and what corrects which joint."""

from __future__ import annotations

import numpy as np

import baselines
import ikgym
from tests.baselines.solvers.fixed_point.test_fixed_point import away, observed, stepped
from tests.comparison import identical

BENT = "planar2-bent"


def test_the_sign_by_growth_changes_where_the_error_has_grown():
    """With the wrong A the first step leads away, and from then on σ = -1; remembered from step to step."""
    policy = baselines.make(
        "fixed_point", BENT, transformation="sign_by_growth", a=-0.1, iterations=1, components=(0, 1)
    )
    wrong = baselines.make("fixed_point", BENT, transformation="none", a=-0.1, iterations=1, components=(0, 1))
    observation, state, signs = away(np.array([1.2, 0.8]), name=BENT), None, []
    for _ in range(4):
        astray = stepped(wrong, observation)[0] - observation["q"]
        q, state, _ = stepped(policy, observation, state)
        signs.append(np.sign((q - observation["q"]) @ astray))
        observation = {**observed(BENT, q), "nominal": observation["nominal"]}
    assert signs == [1, -1, -1, -1]
    assert identical(policy.predict(observation, state, np.array([True]))[0], policy.predict(observation)[0])


def largest_error(transformation, a, steps=3000):
    scenario = ikgym.scenarios.get(BENT).replace(steps=steps)
    policy = baselines.make(
        "fixed_point", scenario, transformation=transformation, a=a, iterations=1, components=(0, 1)
    )
    return baselines.track(scenario, policy).position_error[scenario.counted()[1:]].max()


def test_the_sign_works_for_two_joints():
    """Where both eigenvalues keep one sign: without a Jacobian, and by growth whatever the sign of A."""
    assert largest_error("sign", 1.0) < 1e-3
    assert largest_error("sign", -1.0, 1000) > 0.1
    for a in (1.0, -1.0):
        assert largest_error("sign_by_growth", a) < 5e-3


def test_components_choose_what_corrects_a_joint():
    observation = away(np.array([1.2, 0.8]), name=BENT)
    error = ikgym.arms.get("planar2").forward(observation["q"])[1] - observation["nominal"][0]
    for components in ((0, 1), (1, 0)):
        q, _, _ = stepped(
            baselines.make("fixed_point", BENT, transformation="none", a=0.4, iterations=1, components=components),
            observation,
        )
        np.testing.assert_allclose(q - observation["q"], 0.2 * error[list(components)], rtol=1e-6)
