"""Kernel: random numbers as a function of a key and a counter, without a state."""

from __future__ import annotations

import numpy as np

from ikgym.jit import kernel


@kernel
def uniform(key, counter):
    """A number between -1 and 1 that a key and a counter determine.

    The output function of SplitMix64 (Steele, Lea and Flood 2014), whose state is the counter itself.
    """
    z = key + (counter + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return 2.0 * (np.float64(z >> np.uint64(11)) * 2.0**-53) - 1.0
