"""Kernels: what the steps of all policies share, from the observations to the cut to the velocity limit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from baselines.status import Status
from ikgym.jit import inlined, kernel

_SATURATED, _DIVERGED = int(Status.SATURATED), int(Status.DIVERGED)

#: What the kernel of a step returns for observations that are not finite; else it is what :func:`cut_rows` says.
REFUSED = 2

# The bits of the exponent: all of them are set in infinities and in what is no number, and nowhere else.
_EXPONENT = 0x7FF0000000000000


@kernel
def all_finite(q, qdot, pose, nominal, remaining):
    """Whether all numbers of a batch are finite, without the temporary arrays that NumPy makes.

    A long horizon is compared as integers, several at a time: 1,500 steps take 1.6 µs, as floats one by one 6.
    """
    for array in (q.ravel(), qdot.ravel(), pose.ravel(), remaining.ravel()):
        for value in array:
            if not np.isfinite(value):
                return False
    bits, largest = nominal.ravel().view(np.int64), 0
    for i in range(bits.shape[0]):
        largest = max(largest, bits[i] & _EXPONENT)
    return largest != _EXPONENT


@inlined
def as_rows(n, q, pose, nominal):
    """Joint coordinates (B, n), measured (B, m) and nominal coordinates (B, p, m), from flat ones."""
    rows, m = q.shape[0] // n, nominal.shape[1]
    return q.reshape(rows, n), pose.reshape(rows, m), nominal.reshape(rows, nominal.shape[0] // max(rows, 1), m)


def parts_of(answer: Any, rows: int, n: int) -> tuple[Any, Any, Any]:
    """Views of an answer: joint velocities (B, n), status and iterations (B,)."""
    return answer[2 * rows :].view(np.float64).reshape(rows, n), answer[:rows], answer[rows : 2 * rows]


#: The same for kernels.
answer_parts = inlined(parts_of)


@kernel
def scale_rows(qdot, limit, status):
    """Slows down all joints of a row alike, until each of them is within its limit.

    Args:
        qdot: In [rad/s] or [m/s]; rows that are not finite are left to :func:`cut_rows`. Shape (B, n).
        limit: In [rad/s] or [m/s]. Shape (n,).
        status: Raised to what the row deserves. Shape (B,).
    """
    for row in range(qdot.shape[0]):
        fastest = 1.0
        for j in range(qdot.shape[1]):
            # Where one of them is no number, neither is the largest.
            fraction = abs(qdot[row, j]) / limit[j]
            fastest = fraction if fraction > fastest or np.isnan(fraction) else fastest
        if fastest > 1.0 and np.isfinite(fastest):
            status[row] = max(status[row], _SATURATED)
            for j in range(qdot.shape[1]):
                qdot[row, j] /= fastest


@kernel
def cut_rows(qdot, limit, action, status):
    """Joint velocities as fractions of their limit, within the box, row by row.

    Args:
        qdot: In [rad/s] or [m/s]. Shape (B, n).
        limit: In [rad/s] or [m/s]. Shape (n,).
        action: Receives the actions; zeros where a number is not finite. Shape (B, n).
        status: Raised to what the row deserves. Shape (B,).

    Returns:
        Whether a number of any row is not finite.
    """
    any_lost = False
    for row in range(qdot.shape[0]):
        lost, saturated = False, False
        for j in range(qdot.shape[1]):
            fraction = qdot[row, j] / limit[j]
            if not np.isfinite(fraction):
                lost = True
            elif abs(fraction) > 1.0:
                saturated = True
                fraction = math.copysign(1.0, fraction)
            action[row, j] = fraction
        if lost:
            any_lost = True
            status[row] = _DIVERGED
            for j in range(qdot.shape[1]):
                action[row, j] = 0.0
        elif saturated:
            status[row] = max(status[row], _SATURATED)
    return any_lost
