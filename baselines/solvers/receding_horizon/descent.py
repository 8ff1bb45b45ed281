"""Kernels of a gradient descent with the adaptive step of Varga 2021, section IV."""

from __future__ import annotations

import numpy as np

from baselines.status import Status
from ikgym.jit import kernel

_CONVERGED, _LIMIT, _DIVERGED = int(Status.CONVERGED), int(Status.ITERATION_LIMIT), int(Status.DIVERGED)
GOES_ON = -1


@kernel
def stop_test(value, norm, tolerance, step, most):
    """Whether to stop before the next step.

    Args:
        value: The cost.
        norm: Norm of the gradient.
        tolerance: μ, the norm at which the descent has converged.
        step: Steps made.
        most: Most steps.

    Returns:
        A value of :class:`Status`, or GOES_ON.
    """
    if not (np.isfinite(value) and np.isfinite(norm)):
        return _DIVERGED
    if norm <= tolerance:
        return _CONVERGED
    return _LIMIT if step == most else GOES_ON


@kernel
def adapted(alpha, norm, last_norm, rule):
    """α for the next step: larger where the norm fell, smaller where it rose, within its bounds.

    Args:
        alpha: α.
        norm: Norm of the gradient.
        last_norm: Norm before the last step, 0 before the first.
        rule: Smallest and largest α, and the factor between two.
    """
    alpha_min, alpha_max, factor = rule
    if last_norm == 0.0:
        return alpha
    if norm < last_norm:
        alpha *= factor
    elif norm > last_norm:
        alpha /= factor
    return min(max(alpha, alpha_min), alpha_max)


@kernel
def settle(status, value, first_value, limit, rule, row, qdot, alpha):
    """Finds out a blow-up that looks like convergence, and stops the arm after any.

    A gradient of 0 beyond all limits, at a cost that has risen, is no minimum: the finite differences have drowned.

    Args:
        status: Values of :class:`Status`. Shape (B,).
        value: The last cost.
        first_value: The cost at the start.
        limit: Velocity limit. Shape (n,).
        rule: As above.
        row: Which row.
        qdot: The row's plan, cleared after a blow-up. Shape (HL - 1, n).
        alpha: α, set back after a blow-up. Shape (B,).
    """
    if value > first_value:
        for i in range(qdot.shape[0]):
            for j in range(qdot.shape[1]):
                if abs(qdot[i, j]) > limit[j]:
                    status[row] = _DIVERGED
    if status[row] == _DIVERGED:
        qdot[:] = 0.0
        alpha[row] = rule[0]
