"""Statistics over episodes: geometric means and bootstrap intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ikgym.validation import FloatArray

#: Number of bootstrap resamples.
RESAMPLES = 9999


def geometric_mean(values: Sequence[float] | FloatArray) -> float:
    """Exponential of the mean logarithm; 0 if a value is 0."""
    numbers = np.ravel(values).tolist()
    if min(numbers) <= 0.0:
        return 0.0
    return float(numbers[0]) if len(numbers) == 1 else math.exp(math.fsum(map(math.log, numbers)) / len(numbers))


def geometric_interval(values: Sequence[float] | FloatArray) -> tuple[float, float]:
    """The 95 % percentile-bootstrap interval of a geometric mean.

    Each resample draws training seeds and episodes with replacement. All seeds share the drawn episodes, because every
    seed plays the same ones: an episode that is hard is hard for all of them, and drawing anew for each seed would
    make the interval too narrow. With one seed, episodes alone are resampled. The draws are always the same.

    Args:
        values: Positive numbers, one row per training seed, one column per episode. Shape (s, e) or (e,).

    Returns:
        The 2.5th and the 97.5th percentile.
    """
    logs = np.log(np.atleast_2d(values))
    seeds, episodes = logs.shape
    generator = np.random.default_rng(0)
    drawn = generator.integers(episodes, size=(RESAMPLES, episodes))
    means = np.stack([row[drawn].mean(axis=1) for row in logs], axis=1)
    rows = generator.integers(seeds, size=(RESAMPLES, seeds))
    low, high = np.exp(np.percentile(np.take_along_axis(means, rows, axis=1).mean(axis=1), (2.5, 97.5)))
    return float(low), float(high)
