"""Kernels that several solvers share: arrays for a pose, and the task shift of one row."""

from __future__ import annotations

import numpy as np

from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import expanded, inner


@expanded
def pose_arrays(n, m):
    """Arrays for one pose: rotation (3, 3), position (3,), geometric Jacobian (6, n) and task coordinates (m,)."""
    return np.empty((3, 3)), np.empty(3), np.empty((6, n)), np.empty(m)


@inner
def task_shift(kind, gain, pose, target, present, error, shift):
    """Δx = (X^N(k+1) - X^N(k)) + gain (X^N(k) - x(k)) of one row; ``error`` (e,) receives the last difference."""
    task_kernels.error(kind, target, present, shift)
    task_kernels.error(kind, present, pose, error)
    for i in range(error.shape[0]):
        shift[i] += gain * error[i]
