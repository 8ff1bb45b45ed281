"""What the kernels of both iterations of Zhang 2020 are given and give, and the test for a row that diverges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.status import Status
from ikgym.jit import kernel
from ikgym.validation import FloatArray

CONVERGED, APPLIED, LIMIT = int(Status.CONVERGED), int(Status.APPLIED), int(Status.ITERATION_LIMIT)
DEFICIENT, DIVERGED = int(Status.RANK_DEFICIENT), int(Status.DIVERGED)

#: Singular values below this share of the largest count as zero.
RANK_TOLERANCE = 1e-12


class IterationLimits(NamedTuple):
    """When an iteration stops, and what it may do until then.

    Attributes:
        size: Components of the error, e.
        rank: The rank that J has where nothing is lost.
        longest: Way of each joint in one period at the velocity limit, in [rad] or [m]. Shape (n,).
        tolerance: δ.
        most: N_up.
        one_step: Whether the controller is applied once to the measured pose instead.
    """

    size: int
    rank: int
    longest: FloatArray
    tolerance: float
    most: int
    one_step: bool


class DampingMemory(NamedTuple):
    """What is remembered from the step before; a kernel changes it in place.

    Attributes:
        damping: λ. Shape (B,).
        error: Norm of the error before; infinite where there is none. Shape (B,).
    """

    damping: FloatArray
    error: FloatArray


class Iterates(NamedTuple):
    """What a kernel answers, in place.

    Attributes:
        q: q(k); holds q(k-1) before. Shape (B, n).
        status: Values of :class:`Status`. Shape (B,).
        iterations: Iterations made. Shape (B,).
    """

    q: FloatArray
    status: npt.NDArray[np.int64]
    iterations: npt.NDArray[np.int64]


@kernel
def stop_run_away(here, start, longest, status):
    """Marks a row that has not converged as diverged where a joint has left what it can reach in one period.

    Args:
        here: Joint coordinates in [rad] or [m]. Shape (n,).
        start: Those at the start of the period. Shape (n,).
        longest: Way of each joint in one period at the velocity limit. Shape (n,).
        status: The row's status, changed in place. Shape (1,).
    """
    excess = -np.inf
    for k in range(here.shape[0]):
        excess = max(excess, abs(here[k] - start[k]) - longest[k])
    if status[0] != CONVERGED and excess > 0.0:
        status[0] = DIVERGED
