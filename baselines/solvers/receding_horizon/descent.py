"""Kernels of a gradient descent with the adaptive step of Varga 2021, section IV."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.status import Status
from ikgym.kernels.jit import inner, kernel

_CONVERGED, _LIMIT, DIVERGED = int(Status.CONVERGED), int(Status.ITERATION_LIMIT), int(Status.DIVERGED)
GOES_ON = -1


class DescentMemory(NamedTuple):
    """Memory of the descents of B arms.

    Attributes:
        plan: The joint velocities of the horizon, in [rad/s] or [m/s]. Shape (B, HL - 1, n).
        alpha: α. Shape (B,).
    """

    plan: npt.NDArray[np.float64]
    alpha: npt.NDArray[np.float64]


@inner
def stop_test(value, norm, settings, step):
    """Whether to stop before step number ``step``: a value of :class:`Status`, or GOES_ON."""
    if not (np.isfinite(value) and np.isfinite(norm)):
        return DIVERGED
    if norm <= settings.tolerance:
        return _CONVERGED
    return _LIMIT if step == settings.iterations else GOES_ON


@inner
def adapt_alpha(alpha, norm, last_norm, settings):
    """α for the next step: larger where the norm fell, smaller where it rose, within its bounds; as it is at first."""
    if last_norm == 0.0:
        return alpha
    if norm < last_norm:
        alpha *= settings.alpha_factor
    elif norm > last_norm:
        alpha /= settings.alpha_factor
    return min(max(alpha, settings.alpha_min), settings.alpha_max)


@kernel
def squares(x):
    """The sum of squares; shape (HL - 1, width)."""
    total = 0.0
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            total += x[i, j] * x[i, j]
    return total


@inner
def take_step(x, alpha, gradient):
    """One step x − α g, in place; shapes (HL - 1, width)."""
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            x[i, j] -= alpha * gradient[i, j]


@inner
def stop_if_diverged(status, value, first_value, limit, qdot):
    """Detects divergence that looks like convergence, and clears the plan after any; gives a :class:`Status`.

    A gradient of 0 beyond all limits, at a cost that has risen, is no minimum: the finite differences have drowned.
    """
    if value > first_value:
        for i in range(qdot.shape[0]):
            for j in range(qdot.shape[1]):
                if abs(qdot[i, j]) > limit[j]:
                    status = DIVERGED
    if status == DIVERGED:
        qdot[:] = 0.0
    return status
