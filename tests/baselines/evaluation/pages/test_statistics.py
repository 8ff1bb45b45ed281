"""Bootstrap intervals and performance profiles."""

import numpy as np
import pytest
import scipy.stats

from baselines.evaluation.pages import statistics
from baselines.evaluation.pages.statistics import interval, profile
from ikgym.exceptions import MissingDependencyError


class TestInterval:
    def test_one_seed_is_the_one_level_bootstrap_of_scipy(self):
        values = np.random.default_rng(1).lognormal(size=40)
        for statistic in (np.mean, np.median):
            expected = scipy.stats.bootstrap(
                (values,), statistic, method="percentile", n_resamples=999, random_state=np.random.default_rng(5)
            ).confidence_interval
            assert interval(values[None], statistic, resamples=999, seed=5) == pytest.approx(tuple(expected))

    def test_one_episode_is_that_over_seeds(self):
        values = np.random.default_rng(1).normal(size=(9, 1))
        assert interval(values, resamples=999) == interval(values.T, resamples=999)

    def test_one_run_has_no_width(self):
        assert interval(np.array([[3.0]])) == (3.0, 3.0)

    def test_many_episodes_come_to_the_normal_interval(self):
        values = np.random.default_rng(2).normal(size=(1, 400))
        half = 1.96 * values.std() / 20.0
        low, high = interval(values)
        assert (low, high) == pytest.approx((values.mean() - half, values.mean() + half), abs=0.1 * half)

    def test_variances_of_both_levels_add_up(self):
        rng = np.random.default_rng(3)
        of_seed, of_episode = rng.normal(size=(50, 1)), 2.0 * rng.normal(size=(1, 60))
        low, high = interval(of_seed + of_episode, resamples=2000)
        deviation = np.sqrt(of_seed.var() / 50 + of_episode.var() / 60)
        assert high - low == pytest.approx(2 * 1.96 * deviation, rel=0.1)

    def test_wider_where_seeds_differ(self):
        rng = np.random.default_rng(4)
        alike = np.tile(rng.normal(size=(1, 64)), (5, 1))
        low, high = interval(alike, resamples=999)
        wide = interval(alike + 2.0 * rng.normal(size=(5, 1)), resamples=999)
        assert wide[1] - wide[0] > 2.0 * (high - low)

    def test_seeds_that_are_alike_say_nothing_new(self):
        """Episodes are drawn for all seeds together: five copies of a seed are one, not five times the episodes."""
        one = np.random.default_rng(6).normal(size=(1, 64))
        alone, five = interval(one, resamples=4000), interval(np.tile(one, (5, 1)), resamples=4000)
        assert five[1] - five[0] == pytest.approx(alone[1] - alone[0], rel=0.1)

    def test_same_numbers_same_interval(self):
        values = np.random.default_rng(7).normal(size=(3, 8))
        assert interval(values) == interval(values.copy())
        assert interval(values) != interval(values, seed=1)

    def test_covers_once(self):
        low, high = interval(np.random.default_rng(8).normal(size=(10, 64)), resamples=999)
        assert low < 0.0 < high

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("seeds", "of_seed", "of_episode", "least"), [(10, 0.3, 1.0, 0.9), (1, 0.0, 1.0, 0.9), (5, 1.0, 0.1, 0.75)]
    )
    def test_coverage_of_the_mean_logarithm_of_lognormal_cost_ratios(self, seeds, of_seed, of_episode, least):
        rng, hits, trials = np.random.default_rng(9), 0, 300
        for trial in range(trials):
            cost_ratios = np.exp(of_seed * rng.normal(size=(seeds, 1)) + of_episode * rng.normal(size=(1, 64)))
            low, high = interval(np.log(cost_ratios), resamples=499, seed=trial)
            hits += low <= 0.0 <= high
        assert least <= hits / trials <= 0.985

    def test_without_scipy(self, monkeypatch):
        monkeypatch.setitem(__import__("sys").modules, "scipy.stats", None)
        with pytest.raises(MissingDependencyError, match=r"ikgym\[train\]"):
            interval(np.ones((1, 2)))


class TestProfile:
    def test_by_hand(self):
        cost_ratios = np.array([[1.0, 2.0], [4.0, 1e9]])
        assert profile(cost_ratios, [1.0, 1.9, 2.0, 100.0, 1e9]).tolist() == [0.25, 0.25, 0.5, 0.75, 1.0]


def test_confidence_is_what_the_page_says():
    assert (statistics.CONFIDENCE, statistics.RESAMPLES) == (0.95, 9999)
