"""Durations of the calls of a control loop."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Timing(NamedTuple):
    """Durations of calls in [s].

    Attributes:
        p50: The median.
        p99: The 99th percentile.
    """

    p50: float
    p99: float


def timing_of(name: str, spent: Sequence[float], period: float) -> Timing:
    """The durations of a policy's calls; warns where they are longer than a control period. All in [s]."""
    timing = Timing(*map(float, np.percentile(spent, (50, 99))))
    if timing.p99 > period:
        warnings.warn(
            f"{name} does not keep the control period of {1e3 * period:g} ms: 99 % of its calls take up to "
            f"{1e3 * timing.p99:.2g} ms, half of them {1e3 * timing.p50:.2g} ms.",
            RuntimeWarning,
            stacklevel=3,
        )
    return timing


def use_real_time_priority() -> bool:
    """Lets this process run before all others that are not real-time, where the system permits it; whether it does.

    Call it where everything is compiled: such a process leaves little to others while it computes.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))
    except (AttributeError, OSError):  # not on Linux, or without the right to
        return False
    return True
