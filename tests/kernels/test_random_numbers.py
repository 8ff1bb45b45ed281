"""Random numbers that a key and a counter determine."""

import statistics

import numpy as np

from ikgym.kernels.random_numbers import CUT, normal, share, stream, uniform

KEY = np.uint64(12345)
NUMBERS = 20_000
NORMAL = statistics.NormalDist()


def drawn(function, key, numbers=NUMBERS):
    return np.array([function(key, np.uint64(i)) for i in range(numbers)])


def test_normal_numbers_are_the_inverse_of_their_distribution():
    numbers, shares = drawn(normal, KEY), drawn(share, KEY)
    wanted = [NORMAL.inv_cdf(p) for p in shares]
    np.testing.assert_allclose(numbers, wanted, rtol=0, atol=1e-10)
    assert abs(numbers.mean()) < 4 / NUMBERS**0.5
    assert abs(numbers.std() - 1) < 4 / (2 * NUMBERS) ** 0.5
    assert (np.abs(numbers) > 3).any()  # from the outer region
    assert abs(np.corrcoef(numbers[:-1], numbers[1:])[0, 1]) < 0.03


def test_they_are_cut(monkeypatch):
    """One in five hundred million is: the distribution itself is asked, with shares that hardly ever come."""
    import ikgym.kernels.random_numbers as module

    for share_below, wanted in ((0.0, -CUT), (1e-12, -CUT), (1 - 1e-12, CUT), (2e-9, NORMAL.inv_cdf(2e-9))):
        monkeypatch.setattr(module, "uniform", lambda key, counter, s=share_below: 2.0 * s - 1.0)
        np.testing.assert_allclose(normal.py_func(KEY, np.uint64(0)), wanted, rtol=1e-7)


def test_streams_have_nothing_in_common():
    keys = [KEY, *(np.uint64(stream(KEY, number)) for number in range(10)), np.uint64(stream(np.uint64(0), 0))]
    assert len({int(key) for key in keys}) == len(keys)
    numbers = np.array([drawn(uniform, key, 2000) for key in keys])
    assert abs(np.corrcoef(numbers) - np.eye(len(keys))).max() < 0.1
