"""Comparisons and thresholds that all claims share: like claims have like thresholds."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from baselines.episodes import Episode
from ikgym.validation import FloatArray

#: "More", "smaller", "degraded": a difference of a tenth of the larger value. "Significantly", "considerably": a factor
#: of one and a half.
MORE, CONSIDERABLY = 1.0 / 0.9, 1.5
#: Results are the same if they differ by less than this share. It is also the width of a line in a plot: the
#: share of a path's extent below which an error is not visible.
SAME = 0.01
#: A yank is a joint velocity above this many times the median over time of the fastest joint's.
YANK = 10.0


def larger(value: float, than: float, by: float = MORE) -> bool:
    """Whether a value is larger than another by a factor; if left out, by a tenth of the larger value."""
    return bool(value >= by * than)


def differ(one: float, other: float) -> bool:
    """Whether two values differ by a tenth of the larger one or more."""
    return one != other and (larger(one, other) or larger(other, one))


def above(values: Mapping[str, float], limit: float) -> dict[str, bool]:
    """Whether values are above a limit, by condition."""
    return {name: bool(value > limit) for name, value in values.items()}


def below(values: Mapping[str, float], limit: float) -> dict[str, bool]:
    """Whether values are below a limit, by condition."""
    return {name: bool(value < limit) for name, value in values.items()}


def falls(pairs: Mapping[str, tuple[float, float]]) -> dict[str, bool]:
    """Whether a value falls, from before to after, in the conditions in which it changes by a tenth or more."""
    return {name: after < before for name, (before, after) in pairs.items() if differ(before, after)}


def largest_error(episode: Episode) -> float:
    """The largest position error of an episode in [m]."""
    return float(episode.position_error.max())


def peak_speed(episode: Episode) -> float:
    """The largest speed of a joint in an episode in [rad/s] or [m/s]."""
    return float(np.abs(episode.qdot).max())


def extent(path: FloatArray) -> float:
    """Length of the diagonal of the box around a path of shape (k, m)."""
    return float(np.linalg.norm(np.ptp(path, axis=0)))


def rms(values: FloatArray) -> float:
    """Root mean square, in the unit of the values."""
    return float(np.sqrt(np.mean(np.square(values))))


def roughness(values: FloatArray) -> float:
    """Root mean square of the second differences, in the unit of the values."""
    return rms(np.diff(values, 2, axis=0))


def sign_changes(values: FloatArray) -> list[int]:
    """Indices of the values after which the sign changes. Values of shape (k,)."""
    return list(map(int, np.flatnonzero(np.diff(np.sign(values)))))
