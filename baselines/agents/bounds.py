"""Kernel: actions of agents within the limits of the arm."""

from __future__ import annotations

import numpy as np

from baselines.solvers.quadratic_program.velocity_box import velocity_box
from ikgym.kernels.jit import kernel


@kernel
def keep_rows(limits, dt, velocity_limit, q, last, action):
    """Bounds actions, row by row, as those of the policy `qp`: a joint brakes ahead of its stop. NaN stays NaN.

    Args:
        limits: See :func:`baselines.solvers.quadratic_program.limits.limits_with_braking`. Shape (5, n).
        dt: Δt in [s].
        velocity_limit: Shape (n,).
        q: Shape (B, n).
        last: Joint velocities last applied. Shape (B, n).
        action: Fractions of the velocity limit, changed in place. Shape (B, n).
    """
    n = q.shape[1]
    lower, upper = np.empty(n), np.empty(n)
    for row in range(q.shape[0]):
        velocity_box(limits, dt, q[row], last[row], lower, upper)
        for j in range(n):
            share = action[row, j]
            if share * velocity_limit[j] > upper[j]:
                action[row, j] = upper[j] / velocity_limit[j]
            elif share * velocity_limit[j] < lower[j]:
                action[row, j] = lower[j] / velocity_limit[j]
