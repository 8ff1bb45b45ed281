"""Groups of episodes that differ by their actions alone: each is compared with the others (Kool et al. 2019)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def beside_the_others(advantages: NDArray[np.float32], group_size: int) -> NDArray[np.float32]:
    """Advantages, each less the mean of those of the other arms of its group at the same time.

    Args:
        advantages: Shape (T, N), the arms of a group one after the other.
        group_size: At least 2.
    """
    groups = advantages.reshape(len(advantages), -1, group_size)
    beside = (groups - groups.mean(axis=2, keepdims=True)) * (group_size / (group_size - 1))
    out: NDArray[np.float32] = beside.reshape(advantages.shape).astype(np.float32)
    return out
