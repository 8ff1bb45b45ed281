"""Khan's method in its other readings: eq. 2.9, 𝒩 in 12 dimensions and a Jacobian that is held during a grid point."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from tests.baselines.solvers.fixed_point.test_abstract_rotation import KHAN, jacobian, observed
from tests.baselines.solvers.fixed_point.test_rotations import listing, rotation
from tests.comparison import identical


def variant(scenario, observation, last, at, counter, deformation):
    """One inner iteration of eq. 3.16 or eq. 2.9, with 𝒩 before or behind the Jacobian, which belongs to `at`."""
    q, f, target = observation["q"], observation["pose"], observation["nominal"][0]
    transposed = jacobian(scenario, at).T
    h = target - f if counter == "task" else transposed @ (target - f)
    n = np.eye(len(h)) if counter == "none" else rotation(h, last)[0]
    map_ = transposed @ n if counter == "task" else n @ transposed
    if deformation == "contraction":
        return q + 5e-4 * map_ @ (target - f), h
    return listing(map_ @ f, q, map_ @ target, 100.0, 5e-4, 1e-12, 1e3)[0], h


@pytest.mark.parametrize(
    ("counter", "deformation", "held"),
    [
        ("joints", "contraction", "step"),
        ("none", "contraction", "step"),
        ("task", "rotation", "step"),
        ("task", "contraction", "step"),
        ("joints", "rotation", "point"),
        ("task", "contraction", "point"),
    ],
)
def test_the_other_readings_are_what_they_say(counter, deformation, held):
    """The points of khan8-q1 are held for 60 steps, of which the second begins at step 60."""
    scenario = ikgym.scenarios.get(KHAN).replace(steps=80)
    policy = baselines.make(
        "abstract_rotation", scenario, counter_rotation=counter, deformation=deformation, jacobian=held
    )
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=1)
    observation, _ = env.reset()
    printed_policy, printed_state, apart = baselines.make("abstract_rotation", scenario), None, 0.0
    state, last, at = None, np.zeros(12 if counter == "task" else 8), None
    for k in range(80):
        if held == "step" or k in (0, 60):
            at = observation["q"]
        wanted, last = variant(scenario, observation, last, at, counter, deformation)
        action, state = policy.predict(observation, state)
        qdot = action * scenario.velocity_limit
        np.testing.assert_allclose(qdot, (wanted - observation["q"]) / scenario.dt, rtol=1e-4, atol=1e-6)
        assert np.isnan(policy.angles(state).abstract_rotation[0]) == (deformation == "contraction")
        other, printed_state = printed_policy.predict(observation, printed_state)
        apart = max(apart, abs((action - other) * scenario.velocity_limit).max())
        observation, *_ = env.step(action)
    assert apart > 1e-2, "not told apart from the printed method"


def test_a_held_jacobian_is_let_go_with_the_episode():
    policy = baselines.make("abstract_rotation", KHAN, jacobian="point")
    first, second = observed(KHAN, np.full(8, 0.1)), observed(KHAN, np.linspace(0.2, -0.3, 8))
    fresh, _ = policy.predict(second)
    _, state = policy.predict(first)
    assert not identical(policy.predict(second, state)[0], fresh)
    assert identical(policy.predict(second, state, episode_start=np.array([True]))[0], fresh)
