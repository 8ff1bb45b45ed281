"""Kernels: random numbers as a function of a key and a counter, without a state."""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels.jit import inlined, kernel

#: Normal numbers are cut at this number of standard deviations, which one in five hundred million exceeds.
CUT = 6.0
# The share of a normal distribution below −6 standard deviations.
BEYOND = 9.865876450376981e-10


@inlined
def _mix(z):
    """The output function of SplitMix64 (Steele, Lea and Flood 2014)."""
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@kernel
def stream(key, number):
    """The key of one of the many independent streams of a key.

    Args:
        key: A key, 64 bits.
        number: Which stream, counted from 0.
    """
    return _mix(_mix(np.uint64(key)) ^ ((np.uint64(number) + np.uint64(1)) * np.uint64(0xD1B54A32D192ED03)))


@kernel
def uniform(key, counter):
    """A number between -1 and 1 that a key and a counter determine.

    The output function of SplitMix64 (Steele, Lea and Flood 2014), whose state is the counter itself.
    """
    z = _mix(np.uint64(key) + (np.uint64(counter) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15))
    return 2.0 * (np.float64(z >> np.uint64(11)) * 2.0**-53) - 1.0


@kernel
def share(key, counter):
    """A number from 0 to 1, without 1, that a key and a counter determine."""
    return 0.5 * (uniform(key, counter) + 1.0)


@kernel
def normal(key, counter):
    """A number of the standard normal distribution, cut at ±6, that a key and a counter determine.

    The inverse of the distribution by rational functions, exact to some 1e-16: algorithm AS 241 (Wichura 1988), whose
    outermost region lies beyond the cut.
    """
    q = 0.5 * uniform(key, counter)
    if abs(q) <= 0.425:
        return q * _central(0.180625 - q * q)
    tail = 0.5 - abs(q)
    if tail < BEYOND:
        return math.copysign(CUT, q)
    return math.copysign(_outer(math.sqrt(-math.log(tail)) - 1.6), q)


@inlined
def _central(r):
    """AS 241 within 0.425 of the median."""
    above = 2.5090809287301226727e3 * r + 3.3430575583588128105e4
    above = (above * r + 6.7265770927008700853e4) * r + 4.5921953931549871457e4
    above = (above * r + 1.3731693765509461125e4) * r + 1.9715909503065514427e3
    above = (above * r + 1.3314166789178437745e2) * r + 3.3871328727963666080e0
    below = 5.2264952788528545610e3 * r + 2.8729085735721942674e4
    below = (below * r + 3.9307895800092710610e4) * r + 2.1213794301586595867e4
    below = (below * r + 5.3941960214247511077e3) * r + 6.8718700749205790830e2
    below = (below * r + 4.2313330701600911252e1) * r + 1.0
    return above / below


@inlined
def _outer(r):
    """AS 241 in the tails."""
    above = 7.74545014278341407640e-4 * r + 2.27238449892691845833e-2
    above = (above * r + 2.41780725177450611770e-1) * r + 1.27045825246236838258e0
    above = (above * r + 3.64784832476320460504e0) * r + 5.76949722146069140550e0
    above = (above * r + 4.63033784615654529590e0) * r + 1.42343711074968357734e0
    below = 1.05075007164441684324e-9 * r + 5.47593808499534494600e-4
    below = (below * r + 1.51986665636164571966e-2) * r + 1.48103976427480074590e-1
    below = (below * r + 6.89767334985100004550e-1) * r + 1.67638483018380384940e0
    below = (below * r + 2.05319162663775882187e0) * r + 1.0
    return above / below
