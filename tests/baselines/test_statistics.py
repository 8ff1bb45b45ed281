"""Geometric means and their intervals."""

import numpy as np
import pytest
import scipy.stats

from baselines.statistics import geometric_interval, geometric_mean


def test_one_seed_is_the_bootstrap_of_scipy():
    values = np.random.default_rng(1).lognormal(size=60)
    found = scipy.stats.bootstrap((np.log(values),), np.mean, method="percentile", random_state=0)
    expected = np.exp([found.confidence_interval.low, found.confidence_interval.high])
    assert geometric_interval(values) == pytest.approx(tuple(expected), rel=0.02)


def test_copies_of_a_seed_say_nothing_new():
    assert (geometric_mean([0.0, 5.0]), geometric_mean([2.0, 8.0])) == (0.0, pytest.approx(4.0))
    one = np.random.default_rng(6).lognormal(size=(1, 64))
    assert geometric_interval(np.tile(one, (5, 1))) == pytest.approx(geometric_interval(one), rel=1e-12)


@pytest.mark.slow
def test_coverage():
    rng, hits, trials = np.random.default_rng(9), 0, 150
    seeds, of_seed, of_episode = 10, 0.3, 1.0
    for _ in range(trials):
        logs = of_seed * rng.normal(size=(seeds, 1)) + of_episode * rng.normal(size=(1, 64))
        low, high = geometric_interval(np.exp(logs))
        hits += low <= 1.0 <= high
    assert 0.88 <= hits / trials <= 0.985
