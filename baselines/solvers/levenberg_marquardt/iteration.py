"""What the kernels of both iterations of Zhang 2020 are given and give, and the test for a row that diverges."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from baselines.status import Status
from ikgym.kernels.jit import kernel
from ikgym.validation import FloatArray

CONVERGED, APPLIED, LIMIT = int(Status.CONVERGED), int(Status.APPLIED), int(Status.ITERATION_LIMIT)
DEFICIENT, DIVERGED = int(Status.RANK_DEFICIENT), int(Status.DIVERGED)

#: Singular values below this share of the largest count as zero.
RANK_TOLERANCE = 1e-12


class IterationNumbers(NamedTuple):
    """The parameters of an iteration as its kernel takes them.

    Attributes:
        law: A plain :class:`DampingLaw`.
        size: Components of the error, e.
        rank: The rank that J has where nothing is lost.
        longest: Way of each joint in one period at the velocity limit, in [rad] or [m]. Shape (n,).
        tolerance: δ.
        most: N_up.
        one_step: Whether the controller is applied once to the measured pose instead.
        carry: Whether λ is kept from period to period.
        horizon: n, the points of the horizon; 1 without prediction.
        predicted: Whether the Jacobians follow the predicted path (56).
        whole_horizon: Whether the error of the whole horizon is tested (40), or that of the first point only.
    """

    law: tuple[Any, ...]
    size: int
    rank: int
    longest: FloatArray
    tolerance: float
    most: int
    one_step: bool
    carry: bool
    horizon: int
    predicted: bool
    whole_horizon: bool


class DampingMemory(NamedTuple):
    """What is remembered from the step before; a kernel changes it in place.

    Attributes:
        damping: λ. Shape (B,).
        error: Norm of the error before; infinite where there is none. Shape (B,).
    """

    damping: FloatArray
    error: FloatArray


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


@kernel
def begin(rule, carry, row, memory):
    """Begins a period of one arm with the λ of a rule, unless it is carried on."""
    if not carry:
        memory.damping[row], memory.error[row] = rule.damping, np.inf


@kernel
def finish(dt, rule, row, start, status, memory, here):
    """Turns joint coordinates into joint velocities, and begins anew where the iteration has diverged.

    Args:
        dt: Δt in [s].
        rule: The :class:`DampingLaw`.
        row: Which arm.
        start: Joint coordinates at the start of the period, in [rad] or [m]. Shape (n,).
        status: The status of the row.
        memory: The :class:`DampingMemory`, changed in place.
        here: Joint coordinates at its end; become joint velocities in [rad/s] or [m/s]. Shape (n,).
    """
    diverged = status == DIVERGED
    for k in range(here.shape[0]):
        here[k] = ((start[k] if diverged else here[k]) - start[k]) / dt
    if diverged:
        memory.damping[row], memory.error[row] = rule.damping, np.inf
