"""Intervals of a mean or a median by resampling training seeds and episodes, and performance profiles.

Scipy is needed for the intervals alone; it is no dependency of the package.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ikgym.exceptions import MissingDependencyError
from ikgym.validation import FloatArray

#: Share of the intervals that are to hold the value, and how many times is resampled.
CONFIDENCE, RESAMPLES = 0.95, 9999
#: Of the resampling: the same numbers give the same interval.
SEED = 0

#: A mean or a median, over given axes.
Statistic = Callable[..., Any]


def interval(
    values: FloatArray, statistic: Statistic = np.mean, *, resamples: int = RESAMPLES, seed: int = SEED
) -> tuple[float, float]:
    """The two-level bootstrap interval of a statistic: training seeds outside, episodes inside.

    Each resample draws as many training seeds as there are, with replacement, and then as many episodes, likewise.
    The episodes are drawn once a resample, for all of its seeds together: seeds and episodes are crossed, as every
    seed plays the very same episodes, and one that is hard is hard for all of them. Were they drawn anew for each
    seed, as one does where every seed has episodes of its own, the luck of the episodes would seem to average out
    over the seeds, and the interval would be too narrow. What is resampled together answers the question "what would
    have come out with other training seeds and other episodes?".

    The interval reaches from one percentile of the resampled statistics to another, so that it may be taken of
    logarithms: exp of the interval of a mean logarithm is the interval of a geometric mean. A level with one member,
    such as a policy that has no seed, is not resampled, and the interval is the common one over the other level.

    Where seeds differ much more than episodes, five seeds are few, and an interval of 95 % holds the truth in some
    83 % of cases, with ten in 89 %; where the episodes weigh more it is close to what it says.

    Args:
        values: One row a seed, one column an episode. Shape (s, e).
        statistic: Takes an array and the axes to reduce, as ``axis=``.
        resamples: How many.
        seed: Of the drawing.

    Returns:
        Lower and upper end.

    Raises:
        MissingDependencyError: There is no scipy.
    """
    bootstrap = _bootstrap()
    levels = [axis for axis in (0, 1) if values.shape[axis] > 1]
    if not levels:
        return float(values[0, 0]), float(values[0, 0])

    def resampled(*drawn: Any, axis: int = -1) -> Any:
        del axis  # the last one of each, always
        rows, columns = (
            np.asarray(drawn[levels.index(level)]).astype(np.int64) if level in levels else np.zeros(1, dtype=np.int64)
            for level in (0, 1)
        )
        return statistic(values[rows[..., :, None], columns[..., None, :]], axis=(-2, -1))

    # Scipy resamples samples of numbers, each by itself: here those of the rows and those of the columns.
    found = bootstrap(
        [np.arange(values.shape[level]) for level in levels],
        resampled,
        vectorized=True,
        paired=False,
        n_resamples=resamples,
        confidence_level=CONFIDENCE,
        method="percentile",
        random_state=np.random.default_rng(seed),
    ).confidence_interval
    return float(found.low), float(found.high)


def geometric_interval(values: FloatArray) -> tuple[float, float]:
    """The :func:`interval` of a geometric mean; see there."""
    return _geometric_interval(values.tobytes(), values.shape)


@functools.lru_cache(maxsize=4096)
def _geometric_interval(values: bytes, shape: tuple[int, int]) -> tuple[float, float]:
    """Several tables and a plot show the same interval, and each takes a while."""
    low, high = interval(np.log(np.frombuffer(values).reshape(shape)))
    return float(np.exp(low)), float(np.exp(high))


def profile(cost_ratios: FloatArray, ratios: Sequence[float] | FloatArray) -> FloatArray:
    """The performance profile: the share of runs whose cost ratio is at most each ratio.

    Args:
        cost_ratios: Of all runs, seeds and episodes together; any shape.
        ratios: τ. Shape (r,).

    Returns:
        Shares. Shape (r,).
    """
    runs = np.sort(np.ravel(cost_ratios))
    shares: FloatArray = np.searchsorted(runs, np.asarray(ratios), side="right") / len(runs)
    return shares


def _bootstrap() -> Any:
    try:
        from scipy.stats import bootstrap
    except ImportError:
        raise MissingDependencyError(
            'The intervals of the leaderboard need scipy: pip install "ikgym[train]", or scipy itself.'
        ) from None
    return bootstrap
