"""Where new episodes begin: the costliest again, just before a singularity, off the path."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.training.gradients.arms import Arms
from baselines.training.gradients.starts import EVERY, LEAD, Starts
from ikgym import scenarios

SCENARIO = scenarios.get("varga7-pose-random")
ROWS = np.arange(64)


def begun(replay=0.0, singular=0.0, noise=0.0, scenario=SCENARIO):
    """Arms in their first episodes, and what begins those after."""
    arms = Arms(scenario, len(ROWS), (1, 10))
    arms.begin_new(ROWS, np.random.default_rng(1))
    return arms, Starts(scenario, replay, singular, noise)


def test_what_is_off_changes_nothing():
    arms, starts = begun()
    others, _ = begun()
    one, two = np.random.default_rng(3), np.random.default_rng(3)
    starts.note(arms, ROWS)
    starts.renew(arms, ROWS, one)
    others.begin_new(ROWS, two)
    assert np.array_equal(arms.seed, others.seed)
    assert np.array_equal(arms.q.numpy(), others.q.numpy())
    assert not arms.made.any()
    assert one.random() == two.random()


def test_the_costliest_episodes_are_played_again_most_often():
    arms, starts = begun(replay=0.5)
    arms.played[:], arms.usual[:] = 100.0, 1.0
    arms.spent[:] = 1e3 * np.arange(1, 65)
    first = arms.seed.copy()
    starts.note(arms, ROWS)
    generator, drawn = np.random.default_rng(4), []
    for _ in range(40):
        starts.renew(arms, ROWS, generator)
        drawn += arms.seed.tolist()
    again = np.array([drawn.count(seed) for seed in first.tolist()])
    assert again.sum() / len(drawn) == pytest.approx(0.5, abs=0.05)
    assert again[-1] == again.max()
    assert again[-1] / again.sum() == pytest.approx(1.0 / np.sum(1.0 / np.arange(1, 65)), rel=0.2)
    assert again[:32].sum() < again[48:].sum()


def test_an_episode_that_no_longer_costs_much_is_forgotten_step_by_step():
    arms, starts = begun(replay=1.0)
    arms.played[:], arms.usual[:], arms.spent[:] = 1.0, 1.0, 1.0
    arms.spent[0] = 1e6  # lost
    starts.note(arms, ROWS)
    arms.spent[0] = 1.0
    starts.note(arms, ROWS[:1])
    assert starts._costs[int(arms.seed[0])] == pytest.approx(1e3)
    starts.note(arms, ROWS[:1])
    assert starts._costs[int(arms.seed[0])] == pytest.approx(10.0**1.5)


def test_what_was_seen_of_costs_is_kept():
    arms, starts = begun(replay=0.5)
    arms.played[:], arms.spent[:] = 1.0, 1.0 + ROWS
    starts.note(arms, ROWS)
    other, again = begun(replay=0.5)
    again.restore(starts.state())
    for arms_of, own in ((arms, starts), (other, again)):
        own.renew(arms_of, ROWS, np.random.default_rng(5))
    assert np.array_equal(arms.seed, other.seed)


def test_singular_postures_of_the_path_are_entered_some_steps_before():
    arms, starts = begun(singular=1.0)
    starts.renew(arms, ROWS, np.random.default_rng(6))
    assert (arms.made > 0).mean() > 0.5
    for row in ROWS[:8]:
        path = SCENARIO.nominal_joint_path(int(arms.seed[row]))
        smallest = np.linalg.svd(SCENARIO.arm.jacobian(path), compute_uv=False)[:, -1]
        assert abs(max(int(np.argmin(smallest)) - LEAD, 0) - arms.made[row]) <= EVERY
        np.testing.assert_allclose(arms.q[row], path[arms.made[row]], atol=1e-12)
    assert arms.qdot[arms.made > 0].abs().max() > 0.0


def test_arms_begin_off_their_path_and_within_their_stops():
    scenario = scenarios.get("panda-random")
    arms, starts = begun(noise=0.02, scenario=scenario)
    starts.renew(arms, ROWS, np.random.default_rng(7))
    on_path = np.array([scenario.nominal_joint_path(int(seed))[0] for seed in arms.seed])
    assert np.std(arms.q.numpy() - on_path) == pytest.approx(0.02, rel=0.15)
    starts = Starts(scenario, 0.0, 0.0, 10.0)
    starts.renew(arms, ROWS, np.random.default_rng(8))
    q = arms.q.numpy()
    assert np.array_equal(np.clip(q, scenario.arm.lower, scenario.arm.upper), q)
    assert (q == scenario.arm.lower).any()
