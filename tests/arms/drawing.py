"""Random postures of any arm."""

import numpy as np

from ikgym.arms import Arm


def postures(arm: Arm, count: int, seed: int = 0) -> np.ndarray:
    """Postures within the limits, within half a turn or half a metre where there are none. Shape (count, n)."""
    free = np.where(arm.prismatic, 0.5, np.pi)
    lower, upper = (np.where(np.isfinite(x), x, end) for x, end in ((arm.lower, -free), (arm.upper, free)))
    return np.random.default_rng(seed).uniform(lower, upper, (count, arm.joints))
